//! What is compared: a method, under a load, with receivers.
//!
//! *Purpose.* A row of the table.
//!
//! *Design.* Plain data with an order: methods as they are listed, and within a method loads and receivers.
//!
//! *Limits.* Real boards have the load that they are flashed with and the receivers that are plugged in; they count
//! as unloaded, with the receivers that the options name.

use std::fmt;

use variant::{Image, Load};

use crate::boards::Receivers;
use crate::link::Link;
use crate::method::Method;

/// A method of keeping time, under a load, with receivers, asked by a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Case {
    /// How time is kept.
    pub method: Method,
    /// The receivers' latency.
    pub receivers: Receivers,
    /// How much of the core a load takes that is built in; 0 is none. \[%\]
    pub load: u8,
    /// By which link the boards are asked.
    pub link: Link,
}

impl Case {
    /// A method without a load, by TELEM1.
    #[must_use]
    pub const fn of(method: Method, receivers: Receivers) -> Self {
        Self {
            method,
            receivers,
            load: 0,
            link: Link::Telem1,
        }
    }

    /// What board `index`, counted from 0, is built with.
    #[must_use]
    pub fn image(self, index: usize) -> Image {
        Image {
            load: Load::of(self.load).filter(|load| load.percent() > 0),
            ..self.method.image(index)
        }
    }

    /// Its description in the report.
    #[must_use]
    pub fn title(self) -> String {
        let mut title = self.method.title();
        if self.load > 0 {
            title += &format!(", load {} %", self.load);
        }
        if self.receivers != Receivers::M8 {
            title += &format!(", receivers {}", self.receivers.name());
        }
        if self.link != Link::Telem1 {
            title += &format!(", by {}", self.link);
        }
        title
    }

    /// Its name as a folder's: the method's, and what is not as usual.
    #[must_use]
    pub fn folder(self) -> String {
        let mut name = self.method.folder();
        if self.load > 0 {
            name += &format!("-load-{}", self.load);
        }
        if self.receivers != Receivers::M8 {
            name += &format!("-{}", self.receivers.name());
        }
        if self.link != Link::Telem1 {
            name += &format!("-{}", self.link.name());
        }
        name
    }
}

/// As in `paper-step1`, or `paper-step1, load 60 %, receivers paper`.
impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.method)?;
        if self.load > 0 {
            write!(f, ", load {} %", self.load)?;
        }
        if self.receivers != Receivers::M8 {
            write!(f, ", receivers {}", self.receivers.name())?;
        }
        if self.link != Link::Telem1 {
            write!(f, ", by {}", self.link)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_without_a_load_is_the_methods_own_image() {
        let case = Case::of(Method::PaperStep1, Receivers::M8);
        assert_eq!(case.image(0), Method::PaperStep1.image(0));
        assert_eq!(case.folder(), "paper-step1");
        let loaded = Case {
            load: 60,
            receivers: Receivers::Paper,
            link: Link::Usb,
            ..case
        };
        assert_eq!(loaded.image(1).load, Load::of(60));
        assert_eq!(loaded.folder(), "paper-step1-load-60-paper-usb");
        assert_eq!(
            loaded.to_string(),
            "paper-step1, load 60 %, receivers paper, by USB"
        );
    }
}
