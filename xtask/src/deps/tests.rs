//! Circles in small crates, and what is none.

use std::fs;

use super::circles::of_crate;

/// The circles of the crate with these files; the first is its root.
fn circles(files: &[(&str, &str)]) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, text).expect("a file");
    }
    of_crate(&folder.path().join(files[0].0), folder.path()).expect("sources")
}

/// The only circle of these files.
#[track_caller]
fn circle(files: &[(&str, &str)]) -> String {
    let circles = circles(files);
    assert_eq!(circles.len(), 1, "{circles:#?}");
    circles[0].clone()
}

#[track_caller]
fn assert_none(files: &[(&str, &str)]) {
    assert_eq!(circles(files), [""; 0]);
}

#[test]
fn two_files_that_name_each_other_are_a_circle() {
    let found = circle(&[
        ("lib.rs", "mod a;\nmod b;"),
        ("a.rs", "use crate::b::B;\npub struct A(B);"),
        ("b.rs", "\npub struct B;\nimpl From<crate::a::A> for B {}"),
    ]);
    assert_eq!(
        found,
        "2 files need each other:\n  \
         a.rs:1 uses `crate::b::B` of b.rs\n  \
         b.rs:3 uses `crate::a::A` of a.rs"
    );
}

#[test]
fn a_circle_does_not_hide_behind_a_re_export() {
    let found = circle(&[
        (
            "lib.rs",
            "mod clock;\nmod discipline;\npub use clock::{Clock, Settings};",
        ),
        (
            "clock.rs",
            "use crate::discipline::Discipline;\npub struct Settings;\npub struct Clock(Discipline);",
        ),
        (
            "discipline.rs",
            "pub struct Discipline;\nimpl Discipline { fn new(_: &crate::Settings) {} }",
        ),
    ]);
    assert!(found.starts_with("2 files"), "{found}");
    assert!(
        found.contains("discipline.rs:2 uses `crate::Settings` of clock.rs"),
        "{found}"
    );
}

#[test]
fn nor_behind_several_under_other_names() {
    let found = circle(&[
        ("lib.rs", "mod a;\nmod b;\nmod door;\npub use door::Entry;"),
        (
            "door.rs",
            "pub use super::a::A as Hall;\npub use Hall as Entry;",
        ),
        ("a.rs", "pub struct A(crate::b::B);"),
        ("b.rs", "pub struct B;\nfn f(_: crate::Entry) {}"),
    ]);
    assert!(
        found.contains("b.rs:2 uses `crate::Entry` of a.rs"),
        "{found}"
    );
    assert!(!found.contains("door"), "{found}");
}

#[test]
fn nor_behind_globs() {
    let found = circle(&[
        ("lib.rs", "mod a;\nmod b;\nmod all;\npub use all::*;"),
        ("all.rs", "pub use crate::a::*;\npub use crate::b::*;"),
        ("a.rs", "use crate::*;\npub struct A(B);"),
        ("b.rs", "pub struct B;\nfn f() -> Option<crate::A> { None }"),
    ]);
    assert!(found.starts_with("2 files"), "{found}");
    assert!(found.contains("a.rs:2 uses `B` of b.rs"), "{found}");
}

#[test]
fn a_re_export_needs_what_it_hands_on() {
    for re_export in ["pub use a::A;", "pub use a::*;"] {
        let root = format!("mod a;\npub struct Unit;\n{re_export}");
        circle(&[("lib.rs", &root), ("a.rs", "pub struct A(crate::Unit);")]);
    }
}

#[test]
fn mod_alone_is_none() {
    assert_none(&[
        ("lib.rs", "mod a;\npub const LIMIT: u32 = 1;"),
        (
            "a.rs",
            "mod inner;\nuse super::LIMIT;\npub struct A([u8; LIMIT as usize]);",
        ),
        (
            "a/inner.rs",
            "use super::A;\nimpl A { fn limit() -> u32 { crate::LIMIT } }",
        ),
    ]);
}

#[test]
fn nor_is_a_module_that_is_only_imported() {
    assert_none(&[
        ("lib.rs", "mod a;\nmod b;"),
        ("a.rs", "use crate::b::{self};\npub struct A;"),
        ("b.rs", "use super::a;\npub fn f(_: a::A) {}"),
    ]);
}

#[test]
fn what_tests_need_is_none() {
    let b = "pub struct B;\nimpl B { fn f(_: crate::a::A) {} }";
    for test in [
        "#[cfg(test)]\nmod tests { use crate::b::B; }",
        "#[cfg(test)]\nuse crate::b::B;",
        "#[cfg(all(test, unix))]\nimpl From<crate::b::B> for A {}",
        "#[test]\nfn f() { crate::b::B; }",
        "impl A { #[cfg(test)]\nfn f() -> crate::b::B { crate::b::B } }",
        "fn f() { #[cfg(test)]\nlet _ = crate::b::B; }",
        "#[cfg(test)]\nmod tests;",
    ] {
        assert_none(&[
            ("lib.rs", "mod a;\nmod b;"),
            ("a.rs", &format!("pub struct A;\n{test}")),
            ("a/tests.rs", "use crate::b::B;"),
            ("b.rs", b),
        ]);
    }
    for built in [
        "#[cfg(not(test))]\nuse crate::b::B;",
        "#[cfg(any(test, feature = \"x\"))]\nuse crate::b::B;",
    ] {
        circle(&[
            ("lib.rs", "mod a;\nmod b;"),
            ("a.rs", &format!("pub struct A;\n{built}")),
            ("b.rs", b),
        ]);
    }
}

#[test]
fn paths_are_followed_wherever_they_stand() {
    for need in [
        "use super::super::b::B;",
        "use crate::{b::{B as Other}};",
        "fn f() { use crate::b; b::g(); }",
        "fn f() -> crate::b::B { todo!() }",
        "fn f() { let _ = <crate::b::B as Default>::default(); }",
        "fn f() { assert_eq!(1 + crate::b::LIMIT, 2, \"{}\", 1); }",
        "#[arg(default_value_t = crate::b::LIMIT)]\nstruct Options;",
        "macro_rules! m { () => { $crate::b::g() } }",
        "mod inner { fn f() { super::super::super::b::g(); } }",
        "fn f() { match 1 { crate::b::LIMIT => {} _ => {} } }",
        "trait T: crate::b::Maker {}",
        "fn f() { crate::b::made_by_a_macro(); }",
        "use crate::b::Kind::*;",
    ] {
        circle(&[
            ("lib.rs", "mod a;\nmod b;"),
            ("a.rs", "pub mod deep;"),
            ("a/deep.rs", &format!("pub struct A;\n{need}")),
            (
                "b.rs",
                "use crate::a::deep::A;\npub struct B;\npub enum Kind { One }\n\
                 pub trait Maker {}\npub const LIMIT: u32 = 1;\npub fn g() {}",
            ),
        ]);
    }
}

#[test]
fn names_of_other_crates_are_none() {
    for other in [
        "use ::b::B;",
        "use std::b::B;",
        "use crate::fmt::B;",
        "fn f() -> ::b::B { <u8>::b(); m!(::b::B) }",
    ] {
        assert_none(&[
            ("lib.rs", "mod a;\nmod b;\npub use std::fmt;"),
            ("a.rs", &format!("pub struct A;\n{other}")),
            ("b.rs", "use crate::a::A;\npub struct B;"),
        ]);
    }
}

#[test]
fn a_file_that_an_attribute_names_is_read() {
    let found = circle(&[
        (
            "src/main.rs",
            "#[cfg_attr(feature = \"x\", path = \"boards/x.rs\")]\n\
             #[cfg_attr(feature = \"y\", path = \"boards/y.rs\")]\nmod board;\n\
             #[path = \"elsewhere.rs\"]\nmod b;",
        ),
        ("src/boards/x.rs", "pub struct Board;"),
        ("src/boards/y.rs", "pub struct Board(crate::b::B);"),
        (
            "src/elsewhere.rs",
            "pub struct B;\nfn f(_: crate::board::Board) {}",
        ),
    ]);
    assert!(
        found.contains("src/boards/y.rs:1 uses `crate::b::B` of src/elsewhere.rs"),
        "{found}"
    );
}

#[test]
fn files_in_several_circles_are_shown_by_a_shortest_one() {
    let found = circles(&[
        ("lib.rs", "mod a;\nmod b;\nmod c;\nmod d;\nmod e;\nmod f;"),
        ("a.rs", "pub struct A(crate::b::B);"),
        ("b.rs", "pub struct B(crate::c::C);"),
        ("c.rs", "pub struct C(crate::a::A, crate::b::B);"),
        ("d.rs", "pub struct D(crate::e::E, crate::a::A);"),
        ("e.rs", "pub struct E(crate::d::D);"),
        ("f.rs", "pub struct F(crate::d::D);"),
    ]);
    assert_eq!(
        found,
        [
            "3 files need each other:\n  \
             b.rs:1 uses `crate::c::C` of c.rs\n  \
             c.rs:1 uses `crate::b::B` of b.rs\n  \
             a.rs is in a longer circle",
            "2 files need each other:\n  \
             d.rs:1 uses `crate::e::E` of e.rs\n  \
             e.rs:1 uses `crate::d::D` of d.rs",
        ]
    );
}
