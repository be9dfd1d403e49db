#define_import_path akari_visibility::tree

// Twin: `tree.rs`, where the encoding is. Change both or neither.

const TREE_LEAF: u32 = 0x80000000u;
const LINE_MASK: u32 = 0x3fffffffu;
const KIND_SHIFT: u32 = 30u;
const KIND_ONE_LEAF: u32 = 1u;
const KIND_NO_LEAF: u32 = 2u;

// What a node says. Children: bit 31 and the visibility in 1/255, or the index of a node.
struct TreeNode {
    // Bits of the line.
    line: u32,
    // Child where the line is negative; it is visited first.
    negative: u32,
    // Child where it is positive.
    positive: u32,
}

// Mean visibility of a leaf, 0 to 1.
fn leaf_visibility(link: u32) -> f32 {
    return f32(link & 0xffu) / 255.0;
}

// Index of the first of the two words that hold a node.
fn tree_word(index: u32) -> u32 {
    return (3u * index) >> 1u;
}

// The node of an index, from its two words.
fn tree_node(index: u32, word0: u32, word1: u32) -> TreeNode {
    // 48 bits from bit 0 of word 0 for an even index, from its bit 16 for an odd one.
    let is_odd = (index & 1u) == 1u;
    let head = select(word0, (word0 >> 16u) | (word1 << 16u), is_odd);
    let payload = select(word1 & 0xffffu, word1 >> 16u, is_odd);
    let kind = head >> KIND_SHIFT;
    var node = TreeNode(head & LINE_MASK, TREE_LEAF | (payload & 0xffu), TREE_LEAF | (payload >> 8u));
    if kind == KIND_ONE_LEAF {
        node.positive = index + 1u;
    } else if kind == KIND_NO_LEAF {
        node.negative = index + 1u;
        node.positive = index + 1u + payload;
    }
    return node;
}
