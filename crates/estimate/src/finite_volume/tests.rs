use fem_core::Constant;

use super::*;
use crate::testing::{close, four_triangles, problem, solution};

/// The square (-1, 1)^2 with the action 3 at the centre: z = 4, |D| = 4/3.
fn pressed() -> (Mesh, DiscreteProblem, Solution) {
    let mesh = four_triangles();
    // K at the centre is 4; u_1 = 1 and u_2 = 1 there: 4 t_1 = F_1 + 4, 4 t_2 = F_2 - 4 with F = 4/3 f.
    let problem = problem(&mesh, [vec![2.0; 4], vec![1.0; 4]], [3.0, 6.0]);
    let height = vec![0.0, 0.0, 0.0, 0.0, 1.0];
    let force = vec![0.0, 0.0, 0.0, 0.0, 4.0];
    let solution = solution([height.clone(), height], force, vec![0.0; 5]);
    (mesh, problem, solution)
}

#[test]
fn a_solution_by_hand_has_no_defect() {
    let (mesh, problem, solution) = pressed();
    let method = finite_volume(&problem, &solution);
    assert_eq!(&method.action[..4], [0.0; 4]);
    close(method.action[4], 3.0, 1e-15);
    let defect = method.defect(&mesh, &problem, &solution.displacement);
    assert!(defect.equation < 1e-15, "{defect:?}");
    assert_eq!(
        (defect.gap, defect.action, defect.complementarity),
        (0.0, 0.0, 0.0)
    );
}

#[test]
fn every_condition_is_seen() {
    let (mesh, problem, solution) = pressed();
    let method = finite_volume(&problem, &solution);
    let with = |upper: f64, action: f64| {
        let mut displacement = solution.displacement.clone();
        displacement[0][4] = upper;
        let mut method = method.clone();
        method.action[4] = action;
        method.defect(&mesh, &problem, &displacement)
    };
    // Half a load too much: 4/3 of 1/2 over the diagonals 8 and 4.
    close(with(1.0, 3.5).equation, 0.5 / 3.0 / 1.0, 1e-14);
    let open = with(1.25, 3.0);
    close(open.complementarity, 0.2, 1e-15);
    assert_eq!(open.gap, 0.0);
    close(with(0.75, 3.0).gap, 0.25, 1e-15);
    assert_eq!(with(1.0, -3.0).action, 1.0);
}

#[test]
fn l2_error_by_hand() {
    let (mesh, problem, solution) = pressed();
    let method = finite_volume(&problem, &solution);
    // 3 on an area of 4/3, 0 on the rest; against 1: 4 * 4/3 + 8/3.
    close(
        method.l2_error(&mesh, &Constant(1.0)).unwrap(),
        8f64.sqrt(),
        1e-13,
    );
    // Against the disk of radius 1/2 inside the cell (which reaches from 2/3 to 1/2^(1/2)) with the value 4: 1 there, 9 on the rest.
    let disk = |x: f64, y: f64| if x * x + y * y < 0.25 { 4.0 } else { 0.0 };
    let circle = std::f64::consts::PI / 4.0;
    let exact = circle + 9.0 * (4.0 / 3.0 - circle);
    close(method.l2_error(&mesh, &disk).unwrap(), exact.sqrt(), 1e-4);
}

#[test]
fn dual_cells_are_integrated_exactly_on_finer_meshes() {
    let (mesh, _, _) = pressed();
    let action: Vec<f64> = (0..5).map(f64::from).collect();
    for times in 0..4 {
        let fine = quarter::Quartered::of(&mesh, times);
        fem_core::invariants::check(&fine.mesh).unwrap();
        assert_eq!(fine.mesh.triangle_count(), 4 << (2 * times));
        let sums = cells::loads(&mesh, &fine, &action);
        // The hats add to one: the cells of the corners have the area 2/3 each.
        close(
            sums.iter().sum(),
            (1.0 + 2.0 + 3.0) * 2.0 / 3.0 + 4.0 * 4.0 / 3.0,
            1e-14,
        );
        let (mut x, mut y) = (0.0, 0.0);
        for (p, s) in fine.mesh.points().iter().zip(&sums) {
            x += p[0] * s;
            y += p[1] * s;
        }
        // First moments of the cell of corner (1, 1): two quads, centroid by symmetry on the diagonal. The quad (1,1),
        // (1,0), (2/3,0), (1/2,1/2) has sub-triangles of area 1/6 with centroids (8/9, 1/3) and (13/18, 1/2): 1/6 (29/18 +
        // 15/18) = 11/27 for x + y, twice that for the cell.
        let moment = 11.0 / 27.0;
        // Corners 1 and 2 lie at x = 1, corners 2 and 3 at y = 1; the action of corner 0 is 0.
        close(y, moment * (-1.0 + 2.0 + 3.0), 1e-13);
        assert!(x.abs() < 1e-14, "{x:e}");
    }
    // Without refinement: on its own cell a hat has 11/54 of the element, on each other 7/108.
    let fine = quarter::Quartered::of(&mesh, 0);
    let sums = cells::loads(&mesh, &fine, &[0.0, 0.0, 0.0, 0.0, 1.0]);
    close(sums[4], 4.0 * 11.0 / 54.0, 1e-14);
    close(sums[0], 2.0 * 7.0 / 108.0, 1e-14);
}

#[test]
fn negative_norm_of_a_load_known() {
    // lambda = 2 pi^2 c with c = cos(pi x/2) cos(pi y/2) has the norm |4 c|_1 = 4 (pi^2/2)^(1/2); no action on the discrete side.
    let (mesh, _, _) = pressed();
    let method = FiniteVolume {
        action: vec![0.0; 5],
    };
    let pi = std::f64::consts::PI;
    let load = move |x: f64, y: f64| 2.0 * pi * pi * (0.5 * pi * x).cos() * (0.5 * pi * y).cos();
    let exact = 4.0 * (0.5 * pi * pi).sqrt();
    let found = [3, 4, 5].map(|times| method.negative_error(&mesh, &load, times).unwrap());
    println!("{found:?} {exact}");
    // From below, with the square of the relative error falling like h^2.
    let gap = found.map(|f| 1.0 - (f / exact).powi(2));
    assert!(gap[2] > 0.0 && gap[2] < 3e-3, "{gap:?}");
    for k in 0..2 {
        assert!((3.8..4.2).contains(&(gap[k] / gap[k + 1])), "{gap:?}");
    }
    // The discrete action is taken off: an action equal to the load leaves nothing but the cells of the boundary.
    let constant = FiniteVolume {
        action: vec![2.0; 5],
    };
    let rest = constant.negative_error(&mesh, &Constant(2.0), 3).unwrap();
    assert!(rest < 1e-7, "{rest:e}");
}
