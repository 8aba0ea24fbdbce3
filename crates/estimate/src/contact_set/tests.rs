use std::f64::consts::PI;

use fem_core::Constant;
use fem_core::scale::times_power_of_two;

use super::*;
use crate::testing::{close, four_triangles};

/// n x n squares of (-1, 1)^2 with diagonals along (1, 1), all lengths times `unit`.
fn grid(n: usize, unit: f64) -> Mesh {
    let at = |k: usize| unit * (-1.0 + 2.0 * k as f64 / n as f64);
    let points = (0..=n).flat_map(|j| (0..=n).map(move |i| [at(i), at(j)]));
    let cell = |i: usize, j: usize| {
        let c = |i: usize, j: usize| (j * (n + 1) + i) as u32;
        let [a, b, c, d] = [c(i, j), c(i + 1, j), c(i + 1, j + 1), c(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    let triangles: Vec<_> = (0..n)
        .flat_map(|j| (0..n).flat_map(move |i| cell(i, j)))
        .collect();
    Mesh::new(points.collect(), &triangles, &[], None).unwrap()
}

/// Compares the interior vertices that `discrete` holds for with the points that `exact` holds for.
fn compare(
    mesh: &Mesh,
    discrete: impl Fn([f64; 2]) -> bool,
    exact: impl Fn(f64, f64) -> bool + Send + Sync,
) -> ContactSet {
    let points = mesh.points().iter().zip(mesh.boundary());
    let contact: Vec<bool> = points
        .map(|(p, boundary)| !boundary && discrete(*p))
        .collect();
    let field = move |x: f64, y: f64| f64::from(exact(x, y));
    contact_set(mesh, &contact, &field).unwrap()
}

fn none(_: [f64; 2]) -> bool {
    false
}

#[test]
fn a_square_along_the_edges_of_the_mesh() {
    // 25 vertices with cells of area h^2, h = 1/4; they cover the square. The cell of its corner reaches out by the
    // barycentre at (2h/3, h/3).
    for n in [8, 16, 64] {
        let h = 2.0 / n as f64;
        let inside = |x: f64, y: f64| x.abs() <= 0.5 && y.abs() <= 0.5;
        let found = compare(&grid(n, 1.0), |p| inside(p[0], p[1]), inside);
        let area = (1.0 + h) * (1.0 + h);
        close(found.area, area, 1e-13);
        close(found.exact_area, 1.0, 1e-13);
        close(found.area_error(), area - 1.0, 1e-11);
        close(found.jaccard(), 1.0 / area, 1e-13);
        close(found.hausdorff.unwrap(), 5f64.sqrt() / 3.0 * h, 1e-13);
    }
}

#[test]
fn a_square_across_the_elements() {
    // Vertices at multiples of 1/4; the square of half side 0.6 is cut by straight lines but at its corners.
    let inside = |x: f64, y: f64| x.abs() <= 0.6 && y.abs() <= 0.6;
    let found = compare(&grid(8, 1.0), |p| inside(p[0], p[1]), inside);
    close(found.area, 25.0 / 16.0, 1e-13);
    close(found.exact_area, 1.44, 1e-5);
    // The cells reach to 0.5 + 2h/3 = 0.667, the corner (0.6, 0.6) lies in a cell, but (0.6, 0.5 - h/2) does not: there the
    // cells end at x = 0.5 + h/3. By hand: from the corner's barycentre (2/3, 7/12), 1/15 beyond the side.
    close(found.hausdorff.unwrap(), 1.0 / 15.0, 2e-3);
}

#[test]
fn a_disk_inside_a_cell_and_around_it() {
    // The cell of the centre is a star with corners (1/2, 1/2), (2/3, 0), ... and the area 4/3.
    let mesh = four_triangles();
    let disk = |r: f64| move |x: f64, y: f64| x * x + y * y < r * r;
    let small = compare(&mesh, |_| true, disk(0.25));
    close(small.area, 4.0 / 3.0, 1e-15);
    close(small.exact_area, PI / 16.0, 2e-4);
    close(small.common_area, PI / 16.0, 2e-4);
    close(small.jaccard(), 3.0 * PI / 64.0, 2e-4);
    close(small.hausdorff.unwrap(), 0.5f64.sqrt() - 0.25, 2e-3);
    let large = compare(&mesh, |_| true, disk(0.9));
    close(large.exact_area, PI * 0.81, 1e-4);
    close(large.common_area, 4.0 / 3.0, 1e-13);
    close(large.jaccard(), 4.0 / 3.0 / (PI * 0.81), 1e-4);
    // By symmetry the farthest point of the disk lies between the directions 0 and pi/4.
    let edge: Segment = [[2.0 / 3.0, 0.0], [0.5, 0.5]];
    let farthest = (0..=1000)
        .map(|k| PI / 4000.0 * f64::from(k))
        .map(|phi| nearest::squared_distance([0.9 * phi.cos(), 0.9 * phi.sin()], &edge).sqrt())
        .fold(0.0, f64::max);
    close(large.hausdorff.unwrap(), farthest, 2e-3);
}

#[test]
fn areas_and_distances_are_exact_to_a_small_part_of_the_element() {
    // A circle of radius 0.7 that no vertex knows of; h is the diameter of the elements. The bounds are those of the module
    // head, held even with d = h/8: 2 pi k d^2/12 and k d^2/8, and for the distance its own accuracy.
    for n in [8, 32, 128] {
        let (r, h) = (0.7, 8f64.sqrt() / n as f64);
        let circle = move |x: f64, y: f64| x.hypot(y) < r;
        let found = compare(&grid(n, 1.0), |p| p[0].hypot(p[1]) < 0.3, circle);
        let d = h / 8.0;
        let error = (found.exact_area - PI * r * r).abs();
        println!("{n}: area {error:e}, allowed {:e}", PI * d * d / 6.0);
        assert!(error <= PI * d * d / 6.0, "{n}: {error:e}");
        let star = compare(&grid(n, 1.0), |p| p == [0.0, 0.0], circle);
        // The cell of the origin is a hexagon with corners such as h_x (1/3, -1/3) and h_x (2/3, 1/3): the side between
        // them, h_x/5^(1/2) away from the origin, is the one that the circle's points are farthest from.
        let cell = 2.0 / n as f64 / 5f64.sqrt();
        let error = (star.hausdorff.unwrap() - (r - cell)).abs();
        println!(
            "{n}: distance {error:e}, allowed {:e}",
            d * d / r / 8.0 + r / 1024.0
        );
        assert!(error <= d * d / r / 8.0 + r / 1024.0, "{n}: {error:e}");
    }
}

#[test]
fn fields_are_looked_at_inside_elements_only() {
    // Infinite at a vertex, and a set that ends where an edge runs.
    let mesh = grid(8, 1.0);
    let none = vec![false; mesh.vertex_count()];
    let singular = |x: f64, y: f64| {
        let r = x.hypot(y);
        if x < 0.25 { r.ln().min(1.0 / r) } else { 0.0 }
    };
    let found = contact_set(&mesh, &none, &singular).unwrap();
    close(found.exact_area, 2.5, 1e-13);
}

#[test]
fn empty_sets() {
    let mesh = grid(8, 1.0);
    let both = compare(&mesh, none, |_, _| false);
    assert_eq!((both.area_error(), both.jaccard()), (0.0, 1.0));
    assert_eq!(both.hausdorff, Some(0.0));
    let discrete = compare(&mesh, |p| p == [0.0, 0.0], |_, _| false);
    close(discrete.area_error(), 0.0625, 1e-15);
    assert_eq!(discrete.jaccard(), 0.0);
    assert_eq!(discrete.hausdorff, None);
    let exact = compare(&mesh, none, |x, _| x > 0.3);
    close(exact.area_error(), 1.4, 1e-5);
    assert_eq!((exact.jaccard(), exact.hausdorff), (0.0, None));
}

#[test]
fn sets_without_area_count_as_empty() {
    let mesh = grid(8, 1.0);
    // On a diagonal of the mesh, across it, and in a point that is a vertex.
    for set in [
        |x: f64, y: f64| y == x,
        |x: f64, y: f64| y == -x,
        |x: f64, y: f64| y == 0.3 * x,
        |x: f64, y: f64| x.hypot(y) == 0.0,
    ] {
        let found = compare(&mesh, none, set);
        assert_eq!((found.exact_area, found.jaccard()), (0.0, 1.0));
        assert_eq!(found.hausdorff, Some(0.0));
    }
}

#[test]
fn a_constant_field_is_the_whole_domain() {
    let mesh = grid(8, 1.0);
    let all = compare(&mesh, |_| true, |_, _| true);
    // The cells of boundary vertices are missing: 49 of 64 squares.
    close(all.area, 49.0 / 16.0, 1e-13);
    close(all.exact_area, 4.0, 1e-13);
    // The triangle in the corner (-1, 1) has no interior vertex; its barycentre is as near to the corner as the cells come.
    close(all.hausdorff.unwrap(), 8f64.sqrt() / 3.0 * 0.25, 1e-3);
    let none = vec![false; mesh.vertex_count()];
    let found = contact_set(&mesh, &none, &Constant(-2.0)).unwrap();
    close(found.exact_area, 4.0, 1e-13);
    assert_eq!(found.hausdorff, None);
}

#[test]
fn powers_of_two_change_no_digit() {
    let disk = |unit: f64| move |x: f64, y: f64| (x / unit - 0.1).hypot(y / unit + 0.23) < 0.37;
    let plain = compare(
        &grid(16, 1.0),
        |p| (p[0] + 0.1).hypot(p[1]) < 0.4,
        disk(1.0),
    );
    for exponent in [-200, -7, 1, 150] {
        let unit = times_power_of_two(1.0, exponent);
        let mesh = grid(16, unit);
        let moved = compare(
            &mesh,
            |p| (p[0] / unit + 0.1).hypot(p[1] / unit) < 0.4,
            disk(unit),
        );
        let back = |value: f64, dimension: i32| times_power_of_two(value, -dimension * exponent);
        let found = ContactSet {
            area: back(moved.area, 2),
            exact_area: back(moved.exact_area, 2),
            common_area: back(moved.common_area, 2),
            hausdorff: moved.hausdorff.map(|d| back(d, 1)),
        };
        assert_eq!(found, plain, "2^{exponent}");
    }
}
