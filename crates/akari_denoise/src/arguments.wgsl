// Arguments of an indirect dispatch over the listed pixels.

// As `RESAMPLE_WORKGROUP` in `akari_render::signals`.
const RESAMPLE_WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<storage, read_write> listed: array<u32>;
@group(0) @binding(1) var<storage, read_write> arguments: array<u32>;

@compute @workgroup_size(1)
fn resample_arguments() {
    // The header's second word holds the capacity; the count went on when the list was full.
    let count = min(listed[0], listed[1]);
    listed[0] = count;
    arguments[0] = (count + RESAMPLE_WORKGROUP - 1u) / RESAMPLE_WORKGROUP;
    arguments[1] = 1u;
    arguments[2] = 1u;
}
