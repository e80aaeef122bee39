//! Exact parity of the number of facets that axis-parallel rays intersect.
//!
//! A ray along axis a is displaced by +eps along axis a+1 and +eps^2 along axis a+2 (modulo 3), for
//! an infinitesimal eps > 0, so it never passes through an edge or a vertex. Nothing is rounded:
//! the sign of a polynomial in eps is the sign of its first nonzero term.
//!
//! Coordinates are at most 2^28 and their differences less than 2^29 in absolute value. A product
//! of two differences is below 2^58 and fits i64; a 3 x 3 determinant is below 6 * 2^87 and needs
//! i128.
use crate::lattice::Facet;

/// Whether the rays from `point` along `axis` intersect an odd number of facets: first the ray in
/// the negative direction, then the one in the positive direction.
///
/// No facet may contain `point`. The centroids of leaves that no facet crosses satisfy this.
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

/// Whether the projection of the facet along `axis` contains the displaced point. A projection
/// without area contains nothing.
fn projection_contains(facet: &Facet, point: [i64; 3], axis: usize) -> bool {
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    // For speed only: most facets are far from the ray.
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
    let signs = [[a, b], [b, c], [c, a]].map(|[p, q]| edge_sign(p, q, point, u, v));
    signs[0] == signs[1] && signs[1] == signs[2]
}

/// The side of the projected line from p to q on which the displaced point lies: the sign of
/// `(q - p) x (point + (eps, eps^2) - p)`. It is zero only if p and q have the same projection.
fn edge_sign(p: &[i64; 3], q: &[i64; 3], point: [i64; 3], u: usize, v: usize) -> i64 {
    let (along_u, along_v) = (q[u] - p[u], q[v] - p[v]);
    let undisplaced = along_u * (point[v] - p[v]) - along_v * (point[u] - p[u]);
    let of_eps = -along_v;
    let of_eps_squared = along_u;
    let terms = [undisplaced, of_eps, of_eps_squared];
    terms.into_iter().map(i64::signum).find(|&sign| sign != 0).unwrap_or(0)
}

/// Whether the plane of the facet is above `point` along `axis`.
///
/// The displacement has no effect here. If the plane contained the point itself, the point would
/// lie on the facet: the facet is closed, and its projection contains points arbitrarily close to
/// the point.
fn is_above(facet: &Facet, point: [i64; 3], axis: usize) -> bool {
    let [a, _, _] = facet;
    let offset =
        (0..3).map(|i| i128::from(normal(facet, i)) * i128::from(a[i] - point[i])).sum::<i128>();
    assert!(offset != 0, "the starting point of a ray lies on a facet");
    // The ray intersects the plane at point[axis] + offset / normal[axis].
    (offset > 0) == (normal(facet, axis) > 0)
}

/// Component `axis` of the facet's normal: twice the signed area of its projection along `axis`.
fn normal(facet: &Facet, axis: usize) -> i64 {
    let [a, b, c] = facet;
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u])
}
