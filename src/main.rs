//! The `haarlight` command: parse, run, exit code.

use clap::Parser;
use haarlight::cli::{Cli, guarded, run};
use haarlight::team::Job;
use std::process::ExitCode;

/// What the compiler took for granted that this processor does not have; it would end at some instruction without a word.
#[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
fn is_too_old() -> bool {
    // The standard library's macros answer yes here, for what is taken for granted. Of x86-64-v3 these three came last; processors
    // have all of it or lack one of them.
    let asked = raw_cpuid::CpuId::new();
    let more = asked.get_extended_feature_info();
    let fused = asked.get_feature_info().is_some_and(|f| f.has_fma());
    !fused || !more.is_some_and(|f| f.has_avx2() && f.has_bmi2())
}

#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2")))]
fn is_too_old() -> bool {
    false
}

fn main() -> ExitCode {
    if is_too_old() {
        eprintln!(
            "haarlight: this program was compiled for processors with AVX2, FMA and BMI2 (x86-64-v3), and this one lacks some of them; \
             compile it here with RUSTFLAGS=\"-C target-cpu=native\" cargo install --path ."
        );
        return ExitCode::from(2);
    }
    // Ends the program by itself: 0 after --help, 2 after a mistake on the command line.
    let mut cli = Cli::parse();
    let mut job = Job::default();
    let joined = guarded(job.team(), || {
        job = Job::join()?;
        Ok(0)
    });
    if joined != 0 {
        return ExitCode::from(joined);
    }
    cli.common.team = job.team();
    let code = guarded(job.team(), || run(&cli));
    ExitCode::from(job.end(code))
}
