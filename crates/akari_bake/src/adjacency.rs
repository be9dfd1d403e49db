//! Which triangles meet at a vertex and at an edge.

/// Triangles around each vertex.
#[derive(Debug)]
pub(crate) struct Adjacency {
    /// Where the corners of each vertex begin, and the end of all.
    starts: Vec<u32>,
    /// `3 · triangle + corner`, ascending for each vertex.
    corners: Vec<u32>,
}

impl Adjacency {
    pub(crate) fn new(triangles: &[[u32; 3]]) -> Self {
        let count = triangles
            .iter()
            .flatten()
            .max()
            .map_or(0, |&v| v as usize + 1);
        let mut starts = vec![0_u32; count + 1];
        for &v in triangles.iter().flatten() {
            starts[v as usize + 1] += 1;
        }
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut corners = vec![0; 3 * triangles.len()];
        for (corner, &v) in triangles.iter().flatten().enumerate() {
            let at = &mut next[v as usize];
            corners[*at as usize] = corner as u32;
            *at += 1;
        }
        Self { starts, corners }
    }

    /// Number of vertices.
    pub(crate) fn vertex_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Corners at a vertex.
    pub(crate) fn corners(&self, vertex: u32) -> impl Iterator<Item = (usize, usize)> + '_ {
        let range =
            self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize;
        self.corners[range]
            .iter()
            .map(|&c| (c as usize / 3, c as usize % 3))
    }

    /// Triangles at an edge.
    pub(crate) fn edge<'s>(
        &'s self,
        triangles: &'s [[u32; 3]],
        low: u32,
        high: u32,
    ) -> impl Iterator<Item = usize> + 's {
        let mut last = usize::MAX;
        self.corners(low)
            .map(|(t, _)| t)
            .filter(move |&t| triangles[t].contains(&high))
            .filter(move |&t| std::mem::replace(&mut last, t) != t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_triangles_of_edges() {
        let triangles = [[0, 1, 2], [2, 1, 3], [4, 4, 0]];
        let adjacency = Adjacency::new(&triangles);
        assert_eq!(adjacency.vertex_count(), 5);
        assert_eq!(adjacency.edge(&triangles, 1, 2).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(adjacency.edge(&triangles, 0, 1).collect::<Vec<_>>(), [0]);
        assert_eq!(adjacency.edge(&triangles, 0, 4).collect::<Vec<_>>(), [2]);
        assert_eq!(adjacency.edge(&triangles, 0, 3).count(), 0);
        assert_eq!(adjacency.corners(2).collect::<Vec<_>>(), [(0, 2), (1, 0)]);
    }
}
