//! Joining and leaving the job of an MPI launcher.
//!
//! MPI is started only where a launcher says so, so that a program with the feature works by itself as one without.

use super::ranks::Team;
use crate::error::{Error, Result};

/// Variables by which launchers tell how many ranks there are: Open MPI's, and the process managers' of MPICH and Slurm.
const SIZES: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"];
/// `srun --mpi=pmix` tells a rank only its number, and Slurm beside it how many tasks the step has.
const PMIX: &str = "PMIX_RANK";
const PMIX_SIZE: &str = "SLURM_STEP_NUM_TASKS";

/// The job that this process is part of, from its start to its end.
#[derive(Default)]
pub struct Job {
    team: Team,
    /// Leaves MPI when it goes.
    #[cfg(feature = "mpi")]
    universe: Option<mpi::environment::Universe>,
}

/// How many ranks a launcher says there are; none where there is no launcher.
fn launched() -> Option<usize> {
    let size = |name: &str| std::env::var(name).ok()?.parse().ok();
    let pmix = || {
        std::env::var_os(PMIX)?;
        Some(size(PMIX_SIZE).unwrap_or(1))
    };
    SIZES.into_iter().find_map(size).or_else(pmix)
}

impl Job {
    /// Joins the job of the launcher, if there is one.
    ///
    /// # Errors
    /// There are several ranks and this program knows of none: they would all write the same file. MPI cannot be started.
    #[cfg(not(feature = "mpi"))]
    pub fn join() -> Result<Self> {
        match launched() {
            Some(ranks) if ranks > 1 => Err(Error::input(
                format!("{ranks} ranks"),
                "were started, and this program was built without MPI: each would bake the whole room and write the same file",
                "build it with `--features mpi`, or start one",
            )),
            _ => Ok(Self::default()),
        }
    }

    /// Joins the job of the launcher, if there is one.
    ///
    /// # Errors
    /// MPI cannot be started.
    #[cfg(feature = "mpi")]
    pub fn join() -> Result<Self> {
        use mpi::traits::Communicator;
        if launched().is_none() {
            return Ok(Self::default());
        }
        // One thread speaks to MPI.
        let started = mpi::initialize_with_threading(mpi::Threading::Funneled);
        let Some((universe, _)) = started else {
            return Err(Error::Internal("MPI cannot be started".into()));
        };
        let world = universe.world();
        // Neither is negative.
        let team = Team::new(world.rank() as usize, world.size() as usize);
        Ok(Self {
            team,
            universe: Some(universe),
        })
    }

    /// This rank.
    pub fn team(&self) -> Team {
        self.team
    }

    /// Leaves with an exit code, which is returned. A rank that failed ends all others with it: they may be waiting for what will never come.
    pub fn end(self, code: u8) -> u8 {
        #[cfg(feature = "mpi")]
        {
            use mpi::traits::Communicator;
            if code > 1 && !self.team.is_alone() {
                mpi::topology::SimpleCommunicator::world().abort(code.into());
            }
            // Waits for all.
            drop(self.universe);
        }
        code
    }
}
