//! The program as a user meets it: every scene of `configs/`, the command line, and the files as the real VTK reads them.

mod command_line;
mod configs;
mod growth;
mod run;
mod threads;
mod verify;
mod vtk;
