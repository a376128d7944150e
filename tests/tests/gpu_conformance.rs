//! The inverse on a device passes the suite of all maintainers, in both precisions, with C in one
//! buffer and in many.
//!
//! Without an adapter the tests print SKIP; `REQUIRE_GPU=1` makes that a failure.

use yawara_tests::inverse_suite;

inverse_suite!(gpu, "gpu");
inverse_suite!(gpu_f32, "gpu_f32");
// What these add to the two above is where one buffer ends and the next begins.
inverse_suite!(gpu_in_single_tiles, "gpu@1", 12);
inverse_suite!(gpu_f32_in_pairs_of_tiles, "gpu_f32@2", 12);
