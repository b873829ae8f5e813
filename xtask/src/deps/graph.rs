//! Circles in a graph of files.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::modules::FileId;

/// Which file needs which.
#[derive(Default)]
pub struct Graph {
    needs: BTreeMap<FileId, BTreeSet<FileId>>,
}

/// Files each of which needs all the others.
#[derive(Debug, PartialEq, Eq)]
pub struct Circle {
    /// All of them.
    pub files: Vec<FileId>,
    /// One of the shortest circles among them: each needs the next, the last the first.
    pub shortest: Vec<FileId>,
}

impl Graph {
    /// Notes that `from` needs `to`.
    pub fn add(&mut self, from: FileId, to: FileId) {
        self.needs.entry(from).or_default().insert(to);
    }

    /// Each set of files that need each other (a strongly connected component of more
    /// than one file), by its first file.
    pub fn circles(&self) -> Vec<Circle> {
        let mut circles: Vec<Circle> = Vec::new();
        for &file in self.needs.keys() {
            if circles.iter().any(|circle| circle.files.contains(&file)) {
                continue;
            }
            let files: Vec<FileId> = self
                .reached_from(file)
                .into_keys()
                .filter(|&other| self.reached_from(other).contains_key(&file))
                .collect();
            let shortest = files
                .iter()
                .map(|&file| self.shortest_from(file))
                .min_by_key(Vec::len);
            if let Some(shortest) = shortest {
                circles.push(Circle { files, shortest });
            }
        }
        circles
    }

    /// The shortest way from `file` back to it, which has to exist.
    fn shortest_from(&self, file: FileId) -> Vec<FileId> {
        let before = self.reached_from(file);
        let mut way = Vec::new();
        let mut at = file;
        while let Some(&previous) = before.get(&at) {
            way.push(previous);
            at = previous;
            if at == file {
                break;
            }
        }
        way.reverse();
        way
    }

    /// Each file that `start` needs, through others too, and the one before it on a
    /// shortest way there.
    fn reached_from(&self, start: FileId) -> BTreeMap<FileId, FileId> {
        let mut before = BTreeMap::new();
        let mut waiting = VecDeque::from([start]);
        while let Some(from) = waiting.pop_front() {
            for &to in self.needs.get(&from).into_iter().flatten() {
                before.entry(to).or_insert_with(|| {
                    waiting.push_back(to);
                    from
                });
            }
        }
        before
    }
}
