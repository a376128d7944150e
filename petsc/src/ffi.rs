//! The declarations of PETSc's C interface that this crate calls, as `petscsys.h`, `petscvec.h`, `petscmat.h`,
//! `petscpc.h` and `petscksp.h` have them from 3.18 on: real scalars of double precision, 32-bit indices, and an MPI
//! whose communicators are pointers (Open MPI). [`Petsc::start`](crate::Petsc::start) checks the first two.

use std::ffi::{c_char, c_int, c_void};

/// An object of PETSc.
pub type Object = *mut c_void;
/// A communicator of Open MPI.
pub type Comm = *mut c_void;
/// PetscErrorCode.
pub type Code = c_int;
/// PetscInt.
pub type Int = i32;
/// PetscBool, an enumeration.
pub type Bool = c_int;
/// An error handler.
pub type Handler = unsafe extern "C" fn(
    Comm,
    c_int,
    *const c_char,
    *const c_char,
    Code,
    c_int,
    *const c_char,
    *mut c_void,
) -> Code;

/// InsertMode.
pub const INSERT_VALUES: c_int = 1;
pub const ADD_VALUES: c_int = 2;
/// ScatterMode.
pub const SCATTER_FORWARD: c_int = 0;
pub const SCATTER_REVERSE: c_int = 1;
/// NormType.
pub const NORM_2: c_int = 1;
/// MatAssemblyType.
pub const MAT_FINAL_ASSEMBLY: c_int = 0;
/// MatOption.
pub const MAT_SYMMETRIC: c_int = 1;
pub const MAT_SPD: c_int = 15;
/// KSPNormType.
pub const KSP_NORM_UNPRECONDITIONED: c_int = 2;
/// A size that PETSc finds as the sum of the others'.
pub const DETERMINE: Int = -1;
/// MPI_THREAD_SERIALIZED: calls from any thread, one at a time.
pub const SERIALIZED: c_int = 2;

#[link(name = "petsc_real")]
unsafe extern "C" {
    pub static PETSC_COMM_WORLD: Comm;
    pub static mut PETSC_MPI_THREAD_REQUIRED: c_int;
    pub static PetscGlobalRank: c_int;
    pub static PetscGlobalSize: c_int;

    pub fn PetscInitialize(
        argc: *mut c_int,
        argv: *mut *mut *mut c_char,
        file: *const c_char,
        help: *const c_char,
    ) -> Code;
    pub fn PetscFinalize() -> Code;
    pub fn PetscErrorMessage(
        code: c_int,
        text: *mut *const c_char,
        specific: *mut *mut c_char,
    ) -> Code;
    pub fn PetscPushErrorHandler(handler: Option<Handler>, context: *mut c_void) -> Code;
    pub fn PetscReturnErrorHandler(
        comm: Comm,
        line: c_int,
        function: *const c_char,
        file: *const c_char,
        code: Code,
        kind: c_int,
        message: *const c_char,
        context: *mut c_void,
    ) -> Code;
    pub fn PetscOptionsSetValue(options: Object, name: *const c_char, value: *const c_char)
    -> Code;
    pub fn PetscDataTypeFromString(name: *const c_char, kind: *mut c_int, found: *mut Bool)
    -> Code;
    pub fn PetscDataTypeGetSize(kind: c_int, size: *mut usize) -> Code;

    pub fn VecCreateGhostBlock(
        comm: Comm,
        block: Int,
        local: Int,
        total: Int,
        ghosts: Int,
        ghost: *const Int,
        made: *mut Object,
    ) -> Code;
    pub fn VecGhostGetLocalForm(vector: Object, local: *mut Object) -> Code;
    pub fn VecGhostRestoreLocalForm(vector: Object, local: *mut Object) -> Code;
    pub fn VecGhostUpdateBegin(vector: Object, insert: c_int, scatter: c_int) -> Code;
    pub fn VecGhostUpdateEnd(vector: Object, insert: c_int, scatter: c_int) -> Code;
    pub fn VecGetArray(vector: Object, values: *mut *mut f64) -> Code;
    pub fn VecRestoreArray(vector: Object, values: *mut *mut f64) -> Code;
    pub fn VecGetArrayRead(vector: Object, values: *mut *const f64) -> Code;
    pub fn VecRestoreArrayRead(vector: Object, values: *mut *const f64) -> Code;
    pub fn VecNorm(vector: Object, kind: c_int, norm: *mut f64) -> Code;
    pub fn VecMax(vector: Object, at: *mut Int, value: *mut f64) -> Code;
    pub fn VecDot(a: Object, b: Object, dot: *mut f64) -> Code;
    pub fn VecSum(vector: Object, sum: *mut f64) -> Code;
    pub fn VecDestroy(vector: *mut Object) -> Code;

    pub fn MatCreate(comm: Comm, made: *mut Object) -> Code;
    pub fn MatSetSizes(
        matrix: Object,
        rows: Int,
        columns: Int,
        all_rows: Int,
        all_columns: Int,
    ) -> Code;
    pub fn MatSetBlockSize(matrix: Object, block: Int) -> Code;
    pub fn MatSetType(matrix: Object, name: *const c_char) -> Code;
    pub fn MatXAIJSetPreallocation(
        matrix: Object,
        block: Int,
        own: *const Int,
        others: *const Int,
        own_above: *const Int,
        others_above: *const Int,
    ) -> Code;
    pub fn MatSetOption(matrix: Object, option: c_int, value: Bool) -> Code;
    pub fn MatSetValuesBlocked(
        matrix: Object,
        rows: Int,
        row: *const Int,
        columns: Int,
        column: *const Int,
        values: *const f64,
        insert: c_int,
    ) -> Code;
    pub fn MatZeroEntries(matrix: Object) -> Code;
    pub fn MatAssemblyBegin(matrix: Object, kind: c_int) -> Code;
    pub fn MatAssemblyEnd(matrix: Object, kind: c_int) -> Code;
    pub fn MatNullSpaceCreateRigidBody(coordinates: Object, made: *mut Object) -> Code;
    pub fn MatSetNearNullSpace(matrix: Object, space: Object) -> Code;
    pub fn MatNullSpaceDestroy(space: *mut Object) -> Code;
    pub fn MatDestroy(matrix: *mut Object) -> Code;

    pub fn KSPCreate(comm: Comm, made: *mut Object) -> Code;
    pub fn KSPSetOperators(solver: Object, matrix: Object, preconditioned: Object) -> Code;
    pub fn KSPSetType(solver: Object, name: *const c_char) -> Code;
    pub fn KSPSetNormType(solver: Object, kind: c_int) -> Code;
    pub fn KSPSetTolerances(
        solver: Object,
        relative: f64,
        absolute: f64,
        divergence: f64,
        iterations: Int,
    ) -> Code;
    pub fn KSPSetReusePreconditioner(solver: Object, flag: Bool) -> Code;
    pub fn KSPSetFromOptions(solver: Object) -> Code;
    pub fn KSPSetUp(solver: Object) -> Code;
    pub fn KSPGetPC(solver: Object, preconditioner: *mut Object) -> Code;
    pub fn KSPSolve(solver: Object, load: Object, solution: Object) -> Code;
    pub fn KSPGetIterationNumber(solver: Object, iterations: *mut Int) -> Code;
    pub fn KSPGetConvergedReason(solver: Object, reason: *mut c_int) -> Code;
    pub fn KSPDestroy(solver: *mut Object) -> Code;
    pub fn PCSetType(preconditioner: Object, name: *const c_char) -> Code;
    pub fn PCFactorSetMatSolverType(preconditioner: Object, name: *const c_char) -> Code;
}
