//! The simulated world: a receiver with its latency, an oscillator, a line that damages.
