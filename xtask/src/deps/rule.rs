//! Which package may depend on which.
//!
//! *Design.* The rule is the table of `docs/architecture.md`, the one whose last column
//! is *may depend on*: what a reader sees there is what is checked. In that column a
//! name in backticks is a package of ours or another's; *the logic crates* are all of
//! `firmware/crates`; and of a row that says *no crate may depend on it* that is true.
//! Other words there are for the reader.
//!
//! A logic crate names its outside crates too: no HAL, no embassy, no executor gets in.
//! Only `defmt` may be a feature of each: it turns values into log frames and runs nothing.
//! Any other package may use what it likes from outside, except what the row of another
//! one names: that is its own (`rigless`).
//!
//! *Limits.* Normal dependencies only: tests and build scripts may use what they like.

use anyhow::{Context, Result};
use serde_json::Value;

/// The folder of the logic crates.
const LOGIC: &str = "firmware/crates/";

/// A package of the workspace.
pub struct Package {
    /// What cargo calls it.
    pub name: String,
    /// Where it is, from the workspace's root.
    pub folder: String,
    /// What it depends on.
    pub dependencies: Vec<String>,
}

impl Package {
    fn is_logic(&self) -> bool {
        self.folder.starts_with(LOGIC)
    }
}

/// The packages in cargo's `metadata`.
///
/// # Errors
///
/// When these are not cargo's metadata.
pub fn packages(metadata: &Value) -> Result<Vec<Package>> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let root = text(&metadata["workspace_root"]);
    metadata["packages"]
        .as_array()
        .context("cargo's metadata have no packages")?
        .iter()
        .map(|package| {
            let manifest = text(&package["manifest_path"]);
            let folder = manifest
                .strip_prefix(&root)
                .and_then(|path| path.strip_suffix("/Cargo.toml"))
                .with_context(|| format!("{manifest} is not in the workspace"))?;
            let dependencies = package["dependencies"].as_array().into_iter().flatten();
            Ok(Package {
                name: text(&package["name"]),
                folder: folder.trim_start_matches('/').to_owned(),
                dependencies: dependencies
                    .filter(|dependency| dependency["kind"].is_null())
                    .filter(|it| it["name"] != "defmt" || it["optional"] != true)
                    .map(|dependency| text(&dependency["name"]))
                    .collect(),
            })
        })
        .collect()
}

/// A row of the table.
struct Row<'a> {
    /// The package's folder.
    folder: &'a str,
    /// What it may depend on, by name.
    named: Vec<&'a str>,
    /// It may depend on each logic crate.
    all_logic: bool,
    /// No crate may depend on it.
    leaf: bool,
}

impl Row<'_> {
    fn allows(&self, package: &Package) -> bool {
        self.named.contains(&package.name.as_str()) || self.all_logic && package.is_logic()
    }
}

/// The rows of the first table in `page` that ends with *may depend on*.
fn rows(page: &str) -> Vec<Row<'_>> {
    page.lines()
        .skip_while(|line| !line.ends_with("| may depend on |"))
        .skip(2)
        .map_while(|line| line.strip_prefix('|')?.strip_suffix('|'))
        .filter_map(|row| {
            let (folder, rest) = row.split_once('|')?;
            let (_, may) = rest.rsplit_once('|')?;
            Some(Row {
                folder: folder.trim().trim_matches('`'),
                named: may.split('`').skip(1).step_by(2).collect(),
                all_logic: may.contains("the logic crates"),
                leaf: may.contains("no crate may depend on it"),
            })
        })
        .collect()
}

/// What `packages` break of the rule in `page`, in words.
pub fn violations(page: &str, packages: &[Package]) -> Vec<String> {
    let rows = rows(page);
    let row_of = |package: &Package| rows.iter().find(|row| row.folder == package.folder);
    let mut broken: Vec<String> = rows
        .iter()
        .filter(|row| packages.iter().all(|package| package.folder != row.folder))
        .map(|row| format!("`{}` has a row, but is no package", row.folder))
        .collect();
    for package in packages {
        let Some(row) = row_of(package) else {
            broken.push(format!("`{}` is a package without a row", package.folder));
            continue;
        };
        for name in &package.dependencies {
            let fault = match packages.iter().find(|ours| ours.name == *name) {
                Some(ours) if row_of(ours).is_some_and(|row| row.leaf) => "which no crate may",
                Some(ours) if !row.allows(ours) => "which its row does not name",
                None if row.named.contains(&name.as_str()) => continue,
                None if package.is_logic() => "which its row does not name",
                None if packages.iter().any(|other| {
                    !other.is_logic()
                        && row_of(other).is_some_and(|row| row.named.contains(&name.as_str()))
                }) =>
                {
                    "which belongs to another row"
                }
                _ => continue,
            };
            broken.push(format!("{} depends on {name}, {fault}", package.name));
        }
    }
    broken
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "
| other | table |
|---|---|
| `nowhere` | at all |

| package | is | may depend on |
|---|---|---|
| `firmware/crates/time` | time | nothing |
| `firmware/crates/clock` | a clock of `time` | `time`, `libm` |
| `firmware` | what is flashed | the logic crates, a HAL; no crate may depend on it |
| `host/world` | a world | nothing of ours |
| `host/board` | a board | the logic crates, `world`; the one that knows `emulator` |

| `host/later` | no row | nothing |
";

    /// The page's packages; `package` depends on `on` besides.
    fn with(package: &str, on: &str) -> Vec<Package> {
        let mut packages: Vec<_> = [
            ("firmware/crates/time", ""),
            ("firmware/crates/clock", "time libm"),
            ("firmware", "time clock hal"),
            ("host/world", "rand"),
            ("host/board", "time clock world emulator"),
        ]
        .into_iter()
        .map(|(folder, dependencies)| Package {
            name: folder.rsplit('/').next().expect("a name").to_owned(),
            folder: folder.to_owned(),
            dependencies: dependencies.split_whitespace().map(Into::into).collect(),
        })
        .collect();
        for candidate in &mut packages {
            if candidate.name == package {
                candidate.dependencies.push(on.to_owned());
            }
        }
        packages
    }

    #[test]
    fn what_the_table_names_is_allowed() {
        for (package, on) in [("clock", "time"), ("board", "rand"), ("firmware", "rand")] {
            assert_eq!(violations(PAGE, &with(package, on)), [""; 0]);
        }
    }

    #[test]
    fn what_it_does_not_name_is_not() {
        for (package, on, fault) in [
            ("time", "clock", "which its row does not name"),
            ("time", "libm", "which its row does not name"),
            ("clock", "hal", "which its row does not name"),
            ("world", "time", "which its row does not name"),
            ("firmware", "world", "which its row does not name"),
            ("board", "firmware", "which no crate may"),
            ("world", "emulator", "which belongs to another row"),
        ] {
            assert_eq!(
                violations(PAGE, &with(package, on)),
                [format!("{package} depends on {on}, {fault}")]
            );
        }
    }

    #[test]
    fn each_package_has_a_row_and_each_row_a_package() {
        let mut packages = with("", "");
        packages[3].folder = "host/planet".into();
        assert_eq!(
            violations(PAGE, &packages),
            [
                "`host/world` has a row, but is no package",
                "`host/planet` is a package without a row",
            ]
        );
    }
}
