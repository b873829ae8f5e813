//! Cards as people have them, made by a script, a table of what becomes of each.
//!
//! *Design.* The script lists its cards and makes each as a sparse file. The board's code writes the
//! made log to it in place. Then a judge looks at each block that was written ([`image_check`]).

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::image_check::{self, Row};

/// Makes the table; prints it as Markdown.
///
/// # Errors
///
/// When a card cannot be made, or one was not treated as it should be.
pub fn run(script: &Path, only: &[String]) -> Result<()> {
    let folder = std::env::temp_dir().join(format!("pixclock-cards-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let rows = rows(script, only, &folder);
    std::fs::remove_dir_all(&folder)?;
    let rows = rows?;
    console::print_line!("| card | is | outcome | blocks written | fsck before, after |");
    console::print_line!("|---|---|---|---|---|");
    for (name, about, row) in &rows {
        console::print_line!(
            "| `{name}` | {about} | {} | {} | {} |",
            row.outcome,
            row.written,
            row.fsck
        );
    }
    let saved = rows
        .iter()
        .filter(|(_, _, row)| row.outcome.starts_with("saved"));
    console::print_line!("\n{} cards, {} saved", rows.len(), saved.count());
    let wrong: Vec<_> = rows
        .iter()
        .filter_map(|(name, _, row)| Some(format!("{name}: {}", row.wrong.as_ref()?)))
        .collect();
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}

fn rows(script: &Path, only: &[String], folder: &Path) -> Result<Vec<(String, String, Row)>> {
    let mut rows = Vec::new();
    for line in python(script, &[])?.lines() {
        let (name, about) = line.split_once(' ').unwrap_or((line, ""));
        if !only.is_empty() && !only.iter().any(|one| one == name) {
            continue;
        }
        let image = folder.join("card.img");
        python(script, &[name.as_ref(), image.as_os_str()])?;
        let row = image_check::check(&image, folder).with_context(|| name.to_owned())?;
        console::print_error!("{name}: {}", row.outcome);
        rows.push((name.to_owned(), about.trim().to_owned(), row));
        std::fs::remove_file(&image)?;
    }
    ensure!(!rows.is_empty(), "the script has no such card");
    Ok(rows)
}

fn python(script: &Path, arguments: &[&std::ffi::OsStr]) -> Result<String> {
    let mut command = Command::new("python3");
    let ended = command.arg(script).args(arguments).output();
    let ended = ended.context("cannot start python3")?;
    ensure!(
        ended.status.success(),
        "{command:?}: {}",
        String::from_utf8_lossy(&ended.stderr)
    );
    Ok(String::from_utf8_lossy(&ended.stdout).into_owned())
}
