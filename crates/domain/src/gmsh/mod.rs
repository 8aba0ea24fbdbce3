//! Reads Gmsh meshes: MSH 2.2 and 4.1, ASCII and binary, either byte order.
//!
//! Only triangles with 3 nodes are used. Points and lines are left out; any other element is an
//! error. The physical tag of the surface is the region of its triangles: the first one where
//! there are several, its absolute value (Gmsh marks reversed surfaces with a minus), 0 without.
//! The order of nodes and triangles is that of the file, with unused nodes dropped; clockwise
//! triangles have their last two vertices exchanged.

mod elements;
pub(crate) mod error;
mod scan;
mod soup;
mod v22;
mod v41;

use std::path::Path;

use crate::{GmshError, RawMesh};
use error::{Flaw, GmshFault};
use scan::{Encoding, Scan, Scanner, excerpt};

/// Reads the mesh file at `path`.
pub fn read(path: &Path) -> Result<RawMesh, GmshError> {
    match std::fs::read(path) {
        Ok(bytes) => parse(&bytes, path),
        Err(error) => {
            let flaw = Flaw::from(GmshFault::Io { error });
            Err(GmshError::new(path, flaw))
        }
    }
}

/// Reads a mesh from the content of a file; `path` is only named in errors.
pub fn parse(bytes: &[u8], path: &Path) -> Result<RawMesh, GmshError> {
    parse_bytes(bytes).map_err(|flaw| GmshError::new(path, flaw))
}

fn parse_bytes(bytes: &[u8]) -> Result<RawMesh, Flaw> {
    let mut scan = Scanner::new(bytes);
    let soup = match read_format(&mut scan)? {
        Version::V22 => v22::read(&mut scan)?,
        Version::V41 => v41::read(&mut scan, bytes)?,
    };
    soup.into_mesh(&|at| scan.place_at(at))
}

#[derive(Clone, Copy)]
enum Version {
    V22,
    V41,
}

/// Reads `$MeshFormat`; sets the encoding of `scan`.
fn read_format(scan: &mut Scanner<'_>) -> Scan<Version> {
    if scan.rest().iter().all(u8::is_ascii_whitespace) {
        return Err(GmshFault::Empty.into());
    }
    // Formats 1 and older start with `$NOD`.
    if scan.rest().starts_with(b"$NOD") {
        let found = "1".to_string();
        return Err(scan.flaw(GmshFault::Version { found }));
    }
    if !scan.rest().starts_with(b"$MeshFormat") || scan.section()? != Some("MeshFormat") {
        return Err(GmshFault::NotGmsh.into());
    }
    let Some(line) = scan.text_line() else {
        let section = "MeshFormat".to_string();
        return Err(scan.flaw(GmshFault::Truncated { section }));
    };
    let format = || {
        let found = excerpt(line);
        scan.flaw(GmshFault::Format { found })
    };
    let text = std::str::from_utf8(line).map_err(|_| format())?;
    let words: Vec<&str> = text.split_ascii_whitespace().collect();
    let &[found, file_type, size] = words.as_slice() else {
        return Err(format());
    };
    let version = match found.parse::<f64>() {
        Ok(2.2) => Version::V22,
        Ok(4.1) => Version::V41,
        Ok(_) => {
            let found = found.to_string();
            return Err(scan.flaw(GmshFault::Version { found }));
        }
        Err(_) => return Err(format()),
    };
    // The size of a `double` in version 2.2, of a `size_t` in 4.1.
    let size_bytes = match (version, size) {
        (_, "8") => 8,
        (Version::V41, "4") => 4,
        _ => return Err(format()),
    };
    match file_type {
        "0" => {}
        "1" => {
            scan.end_line();
            let Some(one) = scan.rest().first_chunk::<4>() else {
                let section = "MeshFormat".to_string();
                return Err(scan.flaw(GmshFault::Truncated { section }));
            };
            let big_endian = match one {
                [1, 0, 0, 0] => false,
                [0, 0, 0, 1] => true,
                _ => return Err(scan.flaw(GmshFault::ByteOrder)),
            };
            scan.encoding = Encoding::Binary {
                big_endian,
                size_bytes,
            };
            scan.int("one")?;
        }
        _ => return Err(format()),
    }
    scan.end_section("MeshFormat")?;
    Ok(version)
}

/// The region of a physical tag.
fn region(physical: i32) -> i32 {
    physical.checked_abs().unwrap_or(0)
}
