//! The command line `isodp`.

fn main() {}
