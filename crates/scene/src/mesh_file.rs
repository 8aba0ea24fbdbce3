//! The path of the mesh file in the text of a scene.

use std::path::{self, Path};

use toml_edit::{Document, Value};

/// The text with `domain.mesh.file`, a path relative to `folder`, made absolute; not a byte outside that value changes.
///
/// `None` where there is nothing to change: no mesh file, an absolute path, or one that TOML cannot hold.
pub(crate) fn absolute(text: &str, folder: &Path) -> Option<String> {
    let document = Document::parse(text).ok()?;
    let value = document.get("domain")?.get("mesh")?.get("file")?;
    let file = Path::new(value.as_str()?);
    if file.is_absolute() {
        return None;
    }
    let file = path::absolute(folder.join(file)).ok()?;
    let span = value.span()?;
    let (before, after) = (text.get(..span.start)?, text.get(span.end..)?);
    Some(format!("{before}{}{after}", Value::from(file.to_str()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(text: &str) -> Option<String> {
        absolute(text, Path::new("/scenes"))
    }

    #[cfg(unix)]
    #[test]
    fn nothing_else_changes() {
        for (before, file, after) in [
            (
                "# é\n[domain.mesh] # where\nfile   = ",
                "'a.msh'",
                "  # é\n\n[upper]\nload=1",
            ),
            ("[domain.mesh]\r\nfile = ", "\"a.msh\"", "\r\n\r\n# end\r\n"),
            ("\u{feff}domain.mesh.file=", "\"\"\"\na.msh\"\"\"", "# end"),
            ("domain = { mesh = { file = ", "\"\\u0061.msh\"", " } }\n"),
        ] {
            let expected = format!("{before}\"/scenes/a.msh\"{after}");
            assert_eq!(made(&format!("{before}{file}{after}")), Some(expected));
        }
    }

    #[cfg(unix)]
    #[test]
    fn odd_names_are_quoted() {
        let text = made("[domain.mesh]\nfile = \"\\\"a\\\\'b\\tc\"\n").unwrap();
        let back: toml_edit::DocumentMut = text.parse().unwrap();
        let file = back["domain"]["mesh"]["file"].as_str();
        assert_eq!(file, Some("/scenes/\"a\\'b\tc"));
    }

    #[test]
    fn other_scenes_stay() {
        assert_eq!(made("[domain.disk]\nradius = 2\n"), None);
        let file = path::absolute("a.msh").unwrap();
        assert_eq!(
            made(&format!("[domain.mesh]\nfile = '{}'\n", file.display())),
            None
        );
    }
}
