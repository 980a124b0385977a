//! What the arithmetic of a slave-cycle costs at least: the straight loop, with every octet and without.
//!
//! ```text
//! cargo bench --bench limit             medians [ns per slave-cycle]
//! cargo bench --bench limit -- --test   one short round, only to see that it runs
//! ```
//!
//! Before the time is taken, the loop's results are compared with those of the simulated network, see
//! [`straight::check`].

mod straight;

use straight::effort::Effort;
use straight::{check, encoders};

fn main() {
    let effort = Effort::of_arguments();
    println!("encoders      T_DP   with octets [ns]   without [ns]");
    for number in [1, 8, 32, 122] {
        check::same_results(number, effort.compared);
        let scenario = encoders::scenario(number);
        let (network, start) = encoders::started(&scenario);
        let mut with = check::caught_up::<true>(&scenario, &network, &start);
        let mut without = check::caught_up::<false>(&scenario, &network, &start);
        let [with, without] = effort
            .medians(number, [&mut |cycles| with.run(cycles, &mut ()), &mut |cycles| without.run(cycles, &mut ())]);
        let t_dp = scenario.master.t_dp.to_string();
        println!("{number:>8}  {t_dp:>8}   {with:>16.1}   {without:>12.1}");
    }
}
