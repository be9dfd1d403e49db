//! A PNG file of 8-bit RGB pixels in stored (uncompressed) blocks: same bytes on every platform and with every
//! version of any library, and at the size of our textures no larger than it matters.

/// What the pixels of an image stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// sRGB colours, which the file says.
    Color,
    /// Numbers such as roughness or a normal's components: no colour space is named, so that no viewer converts them.
    Data,
}

/// PNG of `width` × `height` pixels, row by row from the top left.
pub fn encode(width: u32, height: u32, pixels: &[[u8; 3]], content: Content) -> Vec<u8> {
    assert_eq!(
        pixels.len(),
        width as usize * height as usize,
        "pixel count of the image"
    );
    let mut header = Vec::new();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, 2, 0, 0, 0]); // 8 bits per channel, RGB, deflate, adaptive filters, not interlaced

    let mut rows = Vec::with_capacity(pixels.len() * 3 + height as usize);
    for row in pixels.chunks_exact(width as usize) {
        rows.push(0); // filter "none"
        rows.extend(row.iter().flatten());
    }

    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    push_chunk(&mut file, *b"IHDR", &header);
    if content == Content::Color {
        push_chunk(&mut file, *b"sRGB", &[0]); // rendering intent "perceptual"
    }
    push_chunk(&mut file, *b"IDAT", &zlib_stored(&rows));
    push_chunk(&mut file, *b"IEND", &[]);
    file
}

fn push_chunk(file: &mut Vec<u8>, kind: [u8; 4], data: &[u8]) {
    file.extend((data.len() as u32).to_be_bytes());
    let start = file.len();
    file.extend(kind);
    file.extend(data);
    let checksum = crc32(&file[start..]);
    file.extend(checksum.to_be_bytes());
}

/// zlib stream (RFC 1950) of stored deflate blocks (RFC 1951, 3.2.4).
fn zlib_stored(data: &[u8]) -> Vec<u8> {
    let mut stream = vec![0x78, 0x01]; // deflate with a 32 KiB window, fastest; makes the header a multiple of 31
    let mut blocks = data.chunks(usize::from(u16::MAX)).peekable();
    while let Some(block) = blocks.next() {
        let length = block.len() as u16;
        stream.push(u8::from(blocks.peek().is_none())); // final block?
        stream.extend(length.to_le_bytes());
        stream.extend((!length).to_le_bytes());
        stream.extend(block);
    }
    stream.extend(adler32(data).to_be_bytes());
    stream
}

/// CRC-32 as PNG wants it (ISO 3309, reflected polynomial 0xEDB88320).
fn crc32(data: &[u8]) -> u32 {
    let mut crc = !0u32;
    for &byte in data {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 {
                crc >> 1 ^ 0xEDB8_8320
            } else {
                crc >> 1
            };
        }
    }
    !crc
}

/// Adler-32 (RFC 1950, 8.2): both sums modulo the largest prime below 2^16.
fn adler32(data: &[u8]) -> u32 {
    const MODULUS: u32 = 65521;
    let (a, b) = data.iter().fold((1, 0), |(a, b), &byte| {
        let a = (a + u32::from(byte)) % MODULUS;
        (a, (b + a) % MODULUS)
    });
    b << 16 | a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_agree_with_published_values() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926); // the check value of CRC-32/ISO-HDLC
        assert_eq!(crc32(b"IEND"), 0xAE42_6082); // the last bytes of every PNG file
        assert_eq!(adler32(b"Wikipedia"), 0x11E6_0398);
        assert_ne!(crc32(b"123456788"), 0xCBF4_3926);
    }

    #[test]
    fn long_data_is_split_into_blocks() {
        let stream = zlib_stored(&vec![7; 70_000]);
        assert_eq!(stream[2], 0, "the first of two blocks is not final");
        assert_eq!(stream.len(), 2 + 70_000 + 2 * 5 + 4);
        assert_eq!(stream[2 + 5 + 65_535], 1, "the second block is final");
    }
}
