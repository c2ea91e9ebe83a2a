//! The `haarlight` command.

fn main() {}
