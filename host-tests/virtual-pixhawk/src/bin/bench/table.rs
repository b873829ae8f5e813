//! Costs beside their budgets, for people and as JSON.

use serde_json::{Value, json};

/// Costs of noise, by its name.
pub type NoiseCosts = Vec<(&'static str, f64)>;

/// One job's cost beside its budget.
pub struct Row {
    job: &'static str,
    cost: f64,
    budget: f64,
    /// What is allowed for now where the budget is not met.
    for_now: Option<f64>,
    /// What other projects spend on the same job.
    peers: &'static str,
}

impl Row {
    /// The row of `job`, in instructions unless it names another unit.
    pub const fn new(job: &'static str, cost: f64, budget: f64, peers: &'static str) -> Self {
        Self {
            job,
            cost,
            budget,
            for_now: None,
            peers,
        }
    }

    /// A row whose budget is not met: it stays marked, and fails only beyond `most`, so that it gets
    /// no worse.
    pub const fn for_now(self, most: f64) -> Self {
        Self {
            for_now: Some(most),
            ..self
        }
    }

    /// Whether the budget is kept.
    fn is_kept(&self) -> bool {
        self.cost <= self.budget
    }

    /// Whether it costs no more than is allowed.
    pub fn is_allowed(&self) -> bool {
        self.cost <= self.for_now.unwrap_or(self.budget)
    }
}

/// Sections that mask every interrupt: where they begin, and how long the longest was.
pub type Sections = Vec<(String, u64)>;

/// Prints the table.
pub fn print(rows: &[Row], noise: &[(&str, NoiseCosts)], sections: &Sections) {
    console::print_line!(
        "{:<52} {:>8} {:>7}  others",
        "instructions on the virtual board",
        "pixclock",
        "at most"
    );
    for row in rows {
        let decimals = usize::from(row.budget < 10.0 || row.cost.fract() != 0.0);
        console::print_line!(
            "{:<52} {:>8.*} {:>7} {}{}",
            row.job,
            decimals * 2,
            row.cost,
            row.budget,
            if row.is_kept() { " " } else { "!" },
            row.peers
        );
    }
    for (line, costs) in noise {
        console::print_line!("\na byte of noise on the {line} line, beyond its interrupt");
        for (name, cost) in costs {
            console::print_line!("  {name:<50} {cost:>8.2}");
        }
    }
    console::print_line!("\nthe longest sections that mask every interrupt, by where they begin");
    for (function, length) in sections {
        console::print_line!("  {length:>4}  {function}");
    }
}

/// The table as one object.
pub fn to_json(rows: &[Row], noise: &[(&str, NoiseCosts)], sections: &Sections) -> Value {
    let of = |line: &str| -> Value {
        let costs = noise.iter().find(|it| it.0 == line);
        let costs = costs.map(|it| it.1.as_slice()).unwrap_or_default();
        costs
            .iter()
            .map(|&(name, cost)| (name.to_owned(), json!(cost)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    json!({
        "jobs": rows
            .iter()
            .map(|row| json!({
                "job": row.job,
                "instructions": row.cost,
                "budget": row.budget,
                "kept": row.is_kept(),
                "others": row.peers,
            }))
            .collect::<Vec<_>>(),
        "gps_noise": of("GPS"),
        "mavlink_noise": of("MAVLink"),
        "stanag_noise": of("STANAG"),
        "masked": sections
            .iter()
            .map(|(function, length)| json!({"function": function, "instructions": length}))
            .collect::<Vec<_>>(),
    })
}
