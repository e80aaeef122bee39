//! Rays: how many facets lie on either side of a point along an axis, exactly.
//!
//! A ray along axis a is moved by +eps along axis a+1 and +eps^2 along axis a+2 (modulo 3), for an eps
//! smaller than any positive number, so that it never meets an edge or a vertex. Nothing is rounded:
//! the sign of a quantity that depends on eps is the sign of its first term that is not zero.
//!
//! Coordinates are at most 2^28 and differences less than 2^29 in absolute value, so a product of two
//! differences is below 2^58 and fits i64; a determinant of three is below 6 * 2^87 and needs i128.
use crate::lattice::Facet;

/// For the two rays from `point` along `axis`, downwards and upwards: whether an odd number of facets
/// is met.
///
/// `point` is on no facet: the rays are those of leaves that no facet crosses.
#[must_use]
pub fn parities(facets: &[Facet], point: [i64; 3], axis: usize) -> [bool; 2] {
    let mut odd = [false; 2];
    for facet in facets {
        if projection_contains(facet, point, axis) {
            let upwards = is_above(facet, point, axis);
            odd[usize::from(upwards)] ^= true;
        }
    }
    odd
}

/// Whether the facet, projected along `axis`, contains the displaced point. A projection without
/// area contains nothing.
fn projection_contains(facet: &Facet, point: [i64; 3], axis: usize) -> bool {
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    // Far away: only to be quick.
    let [a, b, c] = facet;
    if [u, v]
        .iter()
        .any(|&i| a[i].max(b[i]).max(c[i]) < point[i] || a[i].min(b[i]).min(c[i]) > point[i])
    {
        return false;
    }
    if normal(facet, axis) == 0 {
        return false;
    }
    let turns = [[a, b], [b, c], [c, a]].map(|[p, q]| turn(p, q, point, u, v));
    turns[0] == turns[1] && turns[1] == turns[2]
}

/// On which side of the projected line from p to q the displaced point lies: the sign of
/// `(q - p) x (point + (eps, eps^2) - p)`. It is zero only if p and q have the same projection.
fn turn(p: &[i64; 3], q: &[i64; 3], point: [i64; 3], u: usize, v: usize) -> i64 {
    let (along_u, along_v) = (q[u] - p[u], q[v] - p[v]);
    let undisplaced = along_u * (point[v] - p[v]) - along_v * (point[u] - p[u]);
    let of_eps = -along_v;
    let of_eps_squared = along_u;
    let terms = [undisplaced, of_eps, of_eps_squared];
    terms.into_iter().map(i64::signum).find(|&sign| sign != 0).unwrap_or(0)
}

/// Whether the facet's plane is above `point` along `axis`.
///
/// The displacement may be forgotten here: were the plane at the point itself, the point would be on
/// the facet, as the facet is closed and its projection contains points as near as one likes.
fn is_above(facet: &Facet, point: [i64; 3], axis: usize) -> bool {
    let [a, _, _] = facet;
    let offset =
        (0..3).map(|i| i128::from(normal(facet, i)) * i128::from(a[i] - point[i])).sum::<i128>();
    assert!(offset != 0, "a ray starts on a facet");
    // The plane is met at point[axis] + offset / normal[axis].
    (offset > 0) == (normal(facet, axis) > 0)
}

/// Component `axis` of the facet's normal: twice the area of its projection along `axis`, signed.
fn normal(facet: &Facet, axis: usize) -> i64 {
    let [a, b, c] = facet;
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u])
}
