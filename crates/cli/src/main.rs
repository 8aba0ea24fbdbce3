//! The `membranes` program: arguments in, files and one final line out.

mod args;
mod check;
mod failure;
mod names;
mod number;
mod progress;
mod run;
mod verify;

use std::process::ExitCode;

use args::Task;
use failure::Failure;

#[global_allocator]
static ALLOCATOR: memory::HugePages = memory::HugePages;

fn main() -> ExitCode {
    failure::report_panics();
    let task = match args::parse(std::env::args_os()) {
        Ok(task) => task,
        Err(code) => return ExitCode::from(code),
    };
    let done = std::panic::catch_unwind(|| match &task {
        Task::Run(run) => run::run(run),
        Task::Check(check) => check::check(check),
        Task::Verify(folder) => verify::verify(folder),
        Task::Later(what) => Err(Failure::not_in_this_version(what)),
    });
    match done {
        Ok(Ok(code)) => ExitCode::from(code),
        Ok(Err(failure)) => {
            failure.print();
            ExitCode::from(failure.code)
        }
        Err(_) => ExitCode::from(failure::NUMERICAL),
    }
}
