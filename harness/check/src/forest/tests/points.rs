//! The definition by points.

use super::POINTS;
use contract::import::forest::{Connectivity, Forest};
use contract::sets::Sets;

/// The points of all trees that are the same.
pub struct Points {
    dimension: usize,
    sets: Sets,
}

impl Points {
    fn index(dimension: usize, tree: usize, point: [i64; 3]) -> u32 {
        let along = (0..dimension).rev().fold(tree as i64, |sum, a| sum * (POINTS + 1) + point[a]);
        along as u32
    }

    pub fn of(c: &Connectivity) -> Self {
        let dimension = c.dimension;
        let sets = Sets::new(c.trees * (POINTS as usize + 1).pow(dimension as u32));
        let mut points = Self { dimension, sets };
        for index in 0..c.tree_to_tree.len() {
            let (tree, face) = (index / (2 * dimension), index % (2 * dimension));
            let (other, code) = (c.tree_to_tree[index] as usize, c.tree_to_face[index] as usize);
            let (its, orientation) = (code % (2 * dimension), code / (2 * dimension));
            if (other, code) != (tree, face) && face <= its {
                points.glue((tree, face), (other, its), orientation);
            }
        }
        for (lists, is_edge) in [(&c.edges, true), (&c.corners, false)] {
            for ends in lists.offsets.windows(2) {
                let members = ends[0] as usize..ends[1] as usize;
                let member = |i: usize| (lists.trees[i] as usize, lists.places[i] as usize);
                for i in members.clone() {
                    points.identify(member(members.start), member(i), is_edge);
                }
            }
        }
        points
    }

    /// The corners of a face, as points.
    fn face(&self, face: usize) -> Vec<[i64; 3]> {
        let lies = |p: &[i64; 3]| p[face / 2] == (face % 2) as i64 * POINTS;
        (0..1usize << self.dimension)
            .map(|c| [0, 1, 2].map(|a| (c >> a & 1) as i64 * POINTS))
            .filter(lies)
            .collect()
    }

    /// Corner 0 of the lower face is this corner of the other one; of the two ways to continue, trees remain right-handed in one.
    fn glue(&mut self, (tree, face): (usize, usize), (other, its): (usize, usize), turn: usize) {
        let (a, b) = (self.face(face), self.face(its));
        let minus = |p: [i64; 3], q: [i64; 3]| [0, 1, 2].map(|i| p[i] - q[i]);
        let outward = |face: usize, sign: i64| {
            let mut normal = [0; 3];
            normal[face / 2] = if face % 2 == 1 { sign } else { -sign };
            normal
        };
        let determinant = |[u, v, w]: [[i64; 3]; 3]| {
            (0..3)
                .map(|i| u[i] * (v[(i + 1) % 3] * w[(i + 2) % 3] - v[(i + 2) % 3] * w[(i + 1) % 3]))
                .sum::<i64>()
                .signum()
        };
        let own: Vec<[i64; 3]> =
            a[1..].iter().take(self.dimension - 1).map(|&c| minus(c, a[0])).collect();
        let start = b[turn];
        let steps = |i: usize| minus(b[turn ^ i], start);
        let image = match self.dimension {
            2 => vec![steps(1)],
            _ => [[steps(1), steps(2)], [steps(2), steps(1)]]
                .into_iter()
                .find(|[u, v]| {
                    determinant([*u, *v, outward(its, -1)])
                        == determinant([own[0], own[1], outward(face, 1)])
                })
                .unwrap()
                .to_vec(),
        };
        for i in 0..=POINTS {
            for j in 0..=(if self.dimension == 3 { POINTS } else { 0 }) {
                let at = |start: [i64; 3], steps: &[[i64; 3]]| {
                    [0, 1, 2].map(|a| {
                        start[a] + (i * steps[0][a] + j * steps.last().unwrap()[a]) / POINTS
                    })
                };
                let two = |start, steps: &[[i64; 3]]| match steps.len() {
                    1 => at(start, &[steps[0], [0; 3]]),
                    _ => at(start, steps),
                };
                let (p, q) = (two(a[0], &own), two(start, &image));
                self.sets.union(
                    Self::index(self.dimension, tree, p),
                    Self::index(self.dimension, other, q),
                );
            }
        }
    }

    fn identify(&mut self, first: (usize, usize), second: (usize, usize), is_edge: bool) {
        for i in 0..=(if is_edge { POINTS } else { 0 }) {
            let at = |(tree, place): (usize, usize)| {
                let mut point = [0, 1, 2].map(|a| (place >> a & 1) as i64 * POINTS);
                if is_edge {
                    let axis = place % 12 / 4;
                    let (u, v) = [(1, 2), (0, 2), (0, 1)][axis];
                    point[axis] = if place < 12 { i } else { POINTS - i };
                    point[u] = (place % 2) as i64 * POINTS;
                    point[v] = (place / 2 % 2) as i64 * POINTS;
                }
                Self::index(self.dimension, tree, point)
            };
            self.sets.union(at(first), at(second));
        }
    }

    /// The greatest difference of the levels of leaves that share a point whose coordinates are odd in at least 0, 1 and 2 axes.
    pub fn differences(&mut self, forest: &Forest) -> [i32; 3] {
        let mut levels = vec![(i32::MAX, 0, 0); (POINTS as usize + 1).pow(3) * forest.leaves.len()];
        for (tree, leaves) in forest.leaves.iter().enumerate() {
            for leaf in leaves {
                let (size, unit) = (POINTS >> leaf.level, (1i64 << 30) / POINTS);
                let low = leaf.corner.map(|at| i64::from(at) / unit);
                let along = |a: usize| low[a]..=low[a] + if a < self.dimension { size } else { 0 };
                for (x, y, z) in along(0)
                    .flat_map(|x| along(1).flat_map(move |y| along(2).map(move |z| (x, y, z))))
                {
                    let set = self.sets.root(Self::index(self.dimension, tree, [x, y, z]));
                    let (least, most, odd) = &mut levels[set as usize];
                    *odd = (x % 2 + y % 2 + z % 2) as usize;
                    (*least, *most) = ((*least).min(leaf.level), (*most).max(leaf.level));
                }
            }
        }
        [0, 1, 2].map(|odd| {
            let found = levels.iter().filter(|(least, most, o)| least <= most && *o >= odd);
            found.map(|(least, most, _)| most - least).max().unwrap_or(0)
        })
    }
}
