//! PETSc, and MPI with it, started once in a process.

use std::ffi::{CStr, c_char, c_int};
use std::ptr::{null, null_mut};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use thiserror::Error;

use crate::ffi;

/// What PETSc refuses.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum PetscError {
    /// A call that failed: its name, PETSc's number and what that says of it.
    #[error("PETSc's {call} failed with error {code}: {text}")]
    Call {
        /// The function.
        call: &'static str,
        /// PETSc's number.
        code: i32,
        /// PETSc's words.
        text: String,
    },
    /// A library of other numbers: which, its bytes, and those wanted.
    #[error(
        "this PETSc has a {what} of {got} bytes, want {want}: take one of real doubles and 32-bit indices \
         (Debian's libpetsc-real-dev)"
    )]
    Other {
        /// The type.
        what: &'static str,
        /// Its bytes.
        got: usize,
        /// Those wanted.
        want: usize,
    },
    /// A system that a factor does not solve, and PETSc's reason.
    #[error("PETSc does not solve the system (reason {0}): it is singular to working precision")]
    NotSolved(i32),
    /// More rows than 32-bit indices count.
    #[error("{0} rows are more than 32-bit indices count, want at most {limit}", limit = i32::MAX)]
    TooLarge(usize),
    /// An argument that does not fit the object.
    #[error("{what}: want {want} numbers, got {got}")]
    Length {
        /// The argument.
        what: &'static str,
        /// Numbers wanted.
        want: usize,
        /// Numbers given.
        got: usize,
    },
}

/// What a function of this crate returns.
pub type Result<T> = std::result::Result<T, PetscError>;

/// What multigrid does unless options say otherwise. What couples weakly is not aggregated: without that, iterations grow
/// with the mesh where stiffness jumps. The first two levels have large aggregates: coarse matrices are denser, and would take more
/// memory and time than the finest.
const MULTIGRID: [(&CStr, &CStr); 2] =
    [(c"-pc_gamg_threshold", c"0.02"), (c"-pc_gamg_aggressive_coarsening", c"2")];

/// PETSc is not made for threads: whoever calls it holds this.
static LOCK: Mutex<()> = Mutex::new(());

static SESSION: OnceLock<Result<Petsc>> = OnceLock::new();

/// PETSc as it has been started: what it takes to make its objects.
#[derive(Debug)]
pub struct Petsc {
    rank: usize,
    size: usize,
}

/// The right to call PETSc.
pub(crate) fn locked() -> MutexGuard<'static, ()> {
    LOCK.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether a call was good, by its code.
pub(crate) fn checked(call: &'static str, code: ffi::Code) -> Result<()> {
    if code == 0 {
        return Ok(());
    }
    let (mut text, mut specific): (*const c_char, *mut c_char) = (null(), null_mut());
    // SAFETY: both pointers are to live locals; what PETSc puts there is null or a text of its own that lives until its
    // next error, which the lock that our callers hold keeps off.
    let said = unsafe {
        ffi::PetscErrorMessage(code, &raw mut text, &raw mut specific);
        let words = |text: *const c_char| {
            (!text.is_null()).then(|| CStr::from_ptr(text).to_string_lossy().into_owned())
        };
        [words(text), words(specific)]
    };
    let text = said.into_iter().flatten().filter(|part| !part.trim().is_empty());
    let text = text.collect::<Vec<_>>().join(": ");
    Err(PetscError::Call {
        call,
        code,
        text: text.split_whitespace().collect::<Vec<_>>().join(" "),
    })
}

/// Calls a function of PETSc and checks its code; the lock has to be held.
macro_rules! call {
    ($name:ident($($argument:expr),* $(,)?)) => {
        $crate::session::checked(stringify!($name), $crate::ffi::$name($($argument),*))
    };
}
pub(crate) use call;

impl Petsc {
    /// Starts PETSc, and MPI, or returns what was started before. Options come from the environment (`PETSC_OPTIONS`).
    ///
    /// # Errors
    /// [`PetscError`] where the library refuses, or is one of other numbers.
    pub fn start() -> Result<&'static Self> {
        SESSION.get_or_init(Self::begin).as_ref().map_err(Clone::clone)
    }

    fn begin() -> Result<Self> {
        let _lock = locked();
        // SAFETY: nothing of PETSc runs before this, once in a process and under the lock; texts end with a zero, null
        // pointers are what PETSc takes for "none", and the handler is PETSc's own.
        unsafe {
            ffi::PETSC_MPI_THREAD_REQUIRED = ffi::SERIALIZED;
            // An interrupted study ends as all others do.
            call!(PetscOptionsSetValue(null_mut(), c"-no_signal_handler".as_ptr(), null()))?;
            for (name, value) in MULTIGRID {
                call!(PetscOptionsSetValue(null_mut(), name.as_ptr(), value.as_ptr()))?;
            }
            call!(PetscInitialize(null_mut(), null_mut(), null(), null()))?;
            // What fails is told by us, in one paragraph.
            call!(PetscPushErrorHandler(Some(ffi::PetscReturnErrorHandler), null_mut()))?;
        }
        for (what, name, want) in [("PetscInt", c"int", 4), ("PetscScalar", c"scalar", 8)] {
            let (mut kind, mut found, mut got): (c_int, ffi::Bool, usize) = (0, 0, 0);
            // SAFETY: as above; the results go to live locals.
            unsafe {
                call!(PetscDataTypeFromString(name.as_ptr(), &raw mut kind, &raw mut found))?;
                call!(PetscDataTypeGetSize(kind, &raw mut got))?;
            }
            if got != want {
                return Err(PetscError::Other { what, got, want });
            }
        }
        // SAFETY: PETSc has set both in its start, and leaves them as they are.
        let (rank, size) = unsafe { (ffi::PetscGlobalRank, ffi::PetscGlobalSize) };
        Ok(Self { rank: rank as usize, size: size as usize })
    }

    /// Ends PETSc, and MPI, if it was started; objects have to be gone, and none can be made afterwards. The end of a
    /// process that mpirun has started.
    ///
    /// # Errors
    /// [`PetscError::Call`].
    pub fn finish() -> Result<()> {
        if !matches!(SESSION.get(), Some(Ok(_))) {
            return Ok(());
        }
        let _lock = locked();
        // SAFETY: PETSc runs, and the lock is held; a second call is one too many and returns an error.
        unsafe { call!(PetscFinalize()) }
    }

    /// Number of this process, from 0.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// How many processes there are.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// All processes.
    pub(crate) fn world(&self) -> ffi::Comm {
        // SAFETY: set in the start of PETSc, of which `self` is the proof.
        unsafe { ffi::PETSC_COMM_WORLD }
    }
}

/// A number of rows as PETSc counts them.
pub(crate) fn int(rows: usize) -> Result<ffi::Int> {
    ffi::Int::try_from(rows).map_err(|_| PetscError::TooLarge(rows))
}
