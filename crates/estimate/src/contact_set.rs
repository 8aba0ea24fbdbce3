//! How well the contact set is found: the discrete one against the exact one.
//!
//! The discrete contact set C_h is the union of the barycentric dual cells D_j of the contact vertices; its area is the
//! column `contact_area`. The exact set C is where the field [`crate::Exact`] calls `contact` is not zero. With |.| the
//! area:
//!
//! ```text
//! area error   | |C_h| - |C| |
//! Jaccard      |C_h n C| / |C_h u C|,   1 if both are empty
//! Hausdorff    max( sup_{x in C \ C_h} dist(x, C_h),  sup_{x in C_h \ C} dist(x, C) ),   0 if both are empty, none if one is
//! ```
//!
//! Both sets are taken as unions of convex parts of elements (`cut`): D_j exactly, C with straight lines in pieces of
//! diameter d <= h/3 that its border crosses. A border of length L and curvature k costs at most L k d^2/12 in the areas and
//! k d^2/8 in the distance; the distance itself is found to 1/1024 of itself or of the element's diameter. A part of C
//! thinner than half an element (and than 1/2000 of the domain in area) may fall between the samples, and a set without
//! area, such as a segment or a point, counts as empty.
//!
//! Dual cells of boundary vertices never belong to C_h, since the discrete problem has no multiplier there: where C reaches
//! the boundary a strip of about half an element is missing. Cost: O(N) samples, O(n log n) for the n parts along both
//! borders.

mod cut;
mod distance;
mod nearest;

use fem_core::assemble::dual_areas;
use fem_core::{Field, FieldError, Mesh, TriangleId};

use cut::{CENTRE, Part, cell, divide, point};
use distance::{Source, largest_distance};
use nearest::{Nearest, Segment};

/// The discrete contact set against the exact one, scaled.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ContactSet {
    /// |C_h|, an area.
    pub area: f64,
    /// |C|, an area.
    pub exact_area: f64,
    /// |C_h n C|, an area.
    pub common_area: f64,
    /// Hausdorff distance of the two sets, a length; none if exactly one of them is empty.
    pub hausdorff: Option<f64>,
}

impl ContactSet {
    /// | |C_h| - |C| |, an area.
    pub fn area_error(&self) -> f64 {
        (self.area - self.exact_area).abs()
    }

    /// |C_h n C| / |C_h u C|; 1 if both sets are empty.
    pub fn jaccard(&self) -> f64 {
        let union = self.area + self.exact_area - self.common_area;
        if union == 0.0 {
            1.0
        } else {
            // Equal sets: the three areas are sums in different orders.
            (self.common_area / union).min(1.0)
        }
    }
}

/// Compares a contact set, one flag a vertex, with `exact`, which is not zero inside the exact one.
///
/// # Errors
/// A value of `exact` that is not finite.
pub fn contact_set(
    mesh: &Mesh,
    contact: &[bool],
    exact: &dyn Field,
) -> Result<ContactSet, FieldError> {
    let mut sets = Sets {
        mesh,
        contact,
        exact_area: 0.0,
        common_area: 0.0,
        whole: vec![false; mesh.triangle_count()],
        border: Vec::new(),
        missing: Vec::new(),
        surplus: Vec::new(),
    };
    divide(mesh, exact, &mut |part| sets.add(&part))?;
    let area = dual_areas(mesh)
        .iter()
        .zip(contact)
        .filter(|(_, touches)| **touches)
        .fold(0.0, |sum, (area, _)| sum + area);
    Ok(ContactSet {
        area,
        exact_area: sets.exact_area,
        common_area: sets.common_area,
        hausdorff: sets.hausdorff(area),
    })
}

/// What is gathered from the parts of the elements.
struct Sets<'a> {
    mesh: &'a Mesh,
    contact: &'a [bool],
    exact_area: f64,
    common_area: f64,
    /// Elements that lie in C as a whole.
    whole: Vec<bool>,
    /// Borders of the parts of C in the other elements.
    border: Vec<Segment>,
    /// C \ C_h.
    missing: Vec<Source>,
    /// C_h \ C.
    surplus: Vec<Source>,
}

impl Sets<'_> {
    fn add(&mut self, part: &Part) {
        let t = part.triangle;
        let area = self.mesh.shape(t).area;
        let local = self.mesh.triangles()[t.index()].map(|j| self.contact[j.index()]);
        match part.cell {
            Some(k) => {
                let area = area * part.corners.share();
                self.areas(area, local[k], part.inside);
                let corners = self.mesh.corners(t);
                let places = part.corners.places();
                let mut points = [[0.0; 2]; 4];
                for (p, place) in points.iter_mut().zip(places) {
                    *p = point(&corners, *place);
                }
                let points = &points[..places.len()];
                if part.inside {
                    let ends =
                        (0..points.len()).map(|i| [points[i], points[(i + 1) % points.len()]]);
                    self.border.extend(ends);
                }
                self.differ(t, points, local[k], part.inside);
            }
            None => {
                self.whole[t.index()] = part.inside;
                let corners = self.mesh.corners(t);
                for k in 0..3 {
                    self.areas(area / 3.0, local[k], part.inside);
                    if local[k] != part.inside {
                        let points = cell(k).map(|p| point(&corners, p));
                        self.differ(t, &points, local[k], part.inside);
                    }
                }
            }
        }
    }

    fn areas(&mut self, area: f64, discrete: bool, exact: bool) {
        if exact {
            self.exact_area += area;
            if discrete {
                self.common_area += area;
            }
        }
    }

    fn differ(&mut self, t: TriangleId, points: &[[f64; 2]], discrete: bool, exact: bool) {
        let sources = match (discrete, exact) {
            (false, true) => &mut self.missing,
            (true, false) => &mut self.surplus,
            _ => return,
        };
        let size = self.mesh.shape(t).diameter();
        sources.extend(points[1..].windows(2).map(|w| Source {
            corners: [points[0], w[0], w[1]],
            size,
        }));
    }

    fn hausdorff(mut self, discrete_area: f64) -> Option<f64> {
        match (discrete_area > 0.0, self.exact_area > 0.0) {
            (false, false) => return Some(0.0),
            (true, true) => {}
            _ => return None,
        }
        let discrete = Nearest::new(self.discrete_border());
        let missing = largest_distance(&self.missing, &discrete)?;
        drop(discrete);
        let surplus = if self.surplus.is_empty() {
            0.0
        } else {
            let exact = Nearest::new(self.exact_border());
            largest_distance(&self.surplus, &exact)?
        };
        Some(missing.max(surplus))
    }

    /// The border of C_h: in every element, from the midpoint of an edge whose ends differ to the barycentre.
    fn discrete_border(&self) -> Vec<Segment> {
        let mut border = Vec::new();
        for (t, v) in self.mesh.triangle_ids().zip(self.mesh.triangles()) {
            let contact = v.map(|j| self.contact[j.index()]);
            if contact == [contact[0]; 3] {
                continue;
            }
            let corners = self.mesh.corners(t);
            for k in (0..3).filter(|&k| contact[k] != contact[(k + 1) % 3]) {
                let middle = cell(k)[1];
                border.push([point(&corners, middle), point(&corners, CENTRE)]);
            }
        }
        border
    }

    /// Segments of C that contain its border: those of the parts of elements that are cut, and the edges of whole elements
    /// that touch others or the boundary.
    fn exact_border(&mut self) -> Vec<Segment> {
        let mesh = self.mesh;
        let mut touched = mesh.boundary().to_vec();
        for (v, _) in mesh
            .triangles()
            .iter()
            .zip(&self.whole)
            .filter(|(_, whole)| !**whole)
        {
            v.iter().for_each(|j| touched[j.index()] = true);
        }
        let mut border = std::mem::take(&mut self.border);
        for (t, v) in mesh.triangle_ids().zip(mesh.triangles()) {
            if self.whole[t.index()] && v.iter().any(|j| touched[j.index()]) {
                let c = mesh.corners(t);
                border.extend([[c[0], c[1]], [c[1], c[2]], [c[2], c[0]]]);
            }
        }
        border
    }
}

#[cfg(test)]
mod tests;
