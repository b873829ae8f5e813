//! What a clock's error is on a route: how far two boards that fly it by their own time are apart.
//!
//! *Purpose.* `testbed` leaves, for each method and seed, how far two boards' times differed at each
//! PING. At a speed that is a distance between two places on one route, at the same true moment.
//!
//! *Design.* The first board is where its own time has it, the second where its own time has it; both
//! are on the same lap. A track is straight on beyond its ends.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use testbed::Method;

use super::track::{Track, length, less};

/// How two boards of a method were apart.
pub struct Apart {
    /// The method.
    pub method: Method,
    /// The mean difference of their times. \[ns\]
    pub mean_ns: f64,
    /// Over all seeds: since the start \[s\], and the distance \[m\].
    pub points: Vec<(f64, f64)>,
    /// How many of these are of the first seed.
    pub first_seed: usize,
}

impl Apart {
    /// \[m\]
    pub fn mean_m(&self) -> f64 {
        self.points.iter().map(|it| it.1).sum::<f64>() / self.points.len() as f64
    }

    /// \[m\]
    pub fn most_m(&self) -> f64 {
        self.points.iter().map(|it| it.1).fold(0.0, f64::max)
    }
}

/// What the folder `results` has, method by method, on `track` at a speed.
///
/// # Errors
///
/// When it has nothing, or a file that is not `testbed`'s.
pub fn read(results: &Path, track: &Track, speed_m_s: f64) -> Result<Vec<Apart>> {
    let mut found = Vec::new();
    for method in Method::ALL {
        let folder = results.join(method.folder());
        let mut files: Vec<PathBuf> = fs::read_dir(&folder)
            .into_iter()
            .flatten()
            .map(|seed| Ok(seed?.path().join("difference.csv")))
            .collect::<Result<_>>()?;
        files.sort();
        let (mut points, mut sum_ns, mut first_seed) = (Vec::new(), 0.0, 0);
        for file in files.iter().filter(|file| file.is_file()) {
            let text = fs::read_to_string(file)?;
            for (line, row) in (1..).zip(text.lines()).skip(1) {
                let (sent_ns, ns) =
                    difference(row).with_context(|| format!("{}: line {line}", file.display()))?;
                let first_m = (sent_ns * 1e-9 * speed_m_s).rem_euclid(track.length_m());
                let second_m = first_m + ns * 1e-9 * speed_m_s;
                let apart_m = length(less(track.at(second_m), track.at(first_m)));
                points.push((sent_ns * 1e-9, apart_m));
                sum_ns += ns.abs();
            }
            if first_seed == 0 {
                first_seed = points.len();
            }
        }
        if !points.is_empty() {
            found.push(Apart {
                method,
                mean_ns: sum_ns / points.len() as f64,
                points,
                first_seed,
            });
        }
    }
    ensure!(
        !found.is_empty(),
        "{} has no results of `testbed`",
        results.display()
    );
    Ok(found)
}

/// Sending time and difference of a row: `sequence,sent_ns,board,less_board_1_ns`. \[ns\]
fn difference(row: &str) -> Result<(f64, f64)> {
    let mut numbers = row.split(',').map(str::parse::<i64>);
    let mut next = || anyhow::Ok(numbers.next().context("too short")??);
    let (_, sent_ns, _, ns) = (next()?, next()?, next()?, next()?);
    Ok((sent_ns as f64, ns as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_error_is_43_cm_at_20_m_s_where_it_is_straight() {
        let folder = tempfile::tempdir().unwrap();
        let seed = folder
            .path()
            .join(Method::PaperDefault.folder())
            .join("seed-1");
        fs::create_dir_all(&seed).unwrap();
        let rows = "sequence,sent_ns,board,less_board_1_ns\n0,1000000000,2,21640000\n1,2000000000,2,-21640000\n";
        fs::write(seed.join("difference.csv"), rows).unwrap();
        let found = read(folder.path(), &Track::section(), 20.0).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].mean_ns, found[0].first_seed), (21_640_000.0, 2));
        assert!((found[0].mean_m() - 0.4328).abs() < 1e-9);
        assert!((found[0].most_m() - 0.4328).abs() < 1e-9);

        fs::write(seed.join("difference.csv"), "x\n0,1,2\n").unwrap();
        assert!(read(folder.path(), &Track::section(), 20.0).is_err());
        assert!(read(&seed, &Track::section(), 20.0).is_err());
    }
}
