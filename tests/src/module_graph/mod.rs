//! Which file of a crate uses which: read from the sources, without compiling them.
//!
//! A file uses another if its code outside tests names an item that the other defines, by an import
//! or by a path in the code. Paths are followed through re-exports to the defining file; re-exports
//! and `mod` declarations are no uses themselves. Methods called on a value name no path and are not
//! seen.
//!
//! Open `graph` first: [`Graph`] and its circles. `sources` reads the modules of a package,
//! `paths` finds the paths in their code, `resolve` follows a path to the defining file,
//! `uses` makes the graph of that, `picture` draws it, `workspace` lists the packages.

mod graph;
mod paths;
mod picture;
mod resolve;
mod sources;
mod uses;
mod workspace;

pub use graph::{Graph, Use};
pub use picture::pictures;
pub use uses::{file_graph, folder_graph, package_graph};
pub use workspace::{Package, packages, root_above};
