//! How many steps multigrid takes on meshes of 1e5 to 4e6 vertices.
//!
//! `cargo bench -p membranes --bench steps -- --to 4e6` runs every case of `tests/numerics/counting.rs` once and counts on the first meshes with 1e5, 1e6 and 4e6
//! vertices; without `--to` it ends at 1e5. `--only NAME/NAME` takes some of the cases, `--children 4` divides a marked triangle in four
//! instead of two, `--certify` also counts the steps until eta_alg is small, which takes longer than everything else. Then the same at the smallest size after one step on every mesh, and
//! on meshes of 90 levels. The tests `steps` assert limits on these numbers up to 5e5 vertices. Tables are printed as the documentation quotes them.

use counting::{Case, Counts, Group, How, along_a_run, by_single_steps, left_by_a_run};
use fem_core::Children;

#[path = "../tests/numerics/counting.rs"]
mod counting;

#[global_allocator]
static ALLOCATOR: memory::HugePages = memory::HugePages;

/// Where steps are counted.
const SIZES: [f64; 3] = [1e5, 1e6, 4e6];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str| -> Option<&String> {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1)
    };
    let largest = value("--to").map_or(SIZES[0], |to| to.parse::<f64>().expect("a number"));
    let sizes: Vec<usize> = SIZES
        .iter()
        .filter(|&&size| size <= largest)
        .map(|&size| size as usize)
        .collect();
    let only = value("--only");
    let wanted = |c: &Case| only.is_none_or(|names| names.split('/').any(|name| name == c.name));
    let cases = || Case::all().into_iter().filter(wanted);

    let children = match value("--children").map(String::as_str) {
        None | Some("2") => Children::Two,
        Some("4") => Children::Four,
        Some(other) => panic!("a triangle has 2 or 4 children, not {other}"),
    };

    let how = How {
        children,
        certified: arguments.iter().any(|a| a == "--certify"),
    };
    println!("From the mesh before, along a run:\n\n{}", Counts::HEAD);
    for case in cases() {
        along_a_run(&case, how, &sizes, |c| println!("{}", c.row(&case)));
    }
    println!("\nAfter one step on every mesh:\n\n{}", Counts::HEAD);
    for case in cases().filter(|c| c.group != Group::Checkerboard) {
        println!("{}", by_single_steps(&case, how, sizes[0], 0).row(&case));
    }
    println!(
        "\nThe same, from 90 levels at the origin on:\n\n{}",
        Counts::HEAD
    );
    for case in cases().filter(|c| c.deepens()) {
        println!("{}", by_single_steps(&case, how, sizes[0], 90).row(&case));
    }
    println!(
        "\nAlgebraic error that a run leaves on its meshes, at most, over a fifth of the residual estimator:\n"
    );
    println!("| case | theta 0.5 | theta 0.8 |\n|---|---|---|");
    for case in cases() {
        let [half, most] = [0.5, 0.8].map(|theta| {
            let left = left_by_a_run(&case, theta, sizes[0]);
            left.iter().map(|l| l.1).fold(0.0, f64::max)
        });
        println!("| {} | {half:.3} | {most:.3} |", case.name);
    }
}
