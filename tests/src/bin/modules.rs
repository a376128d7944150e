//! `modules`: which files of each crate use each other, and the circles among them.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use yawara_tests::module_graph::{
    Graph, folder_graph, package_graph, packages, pictures, root_above,
};

/// Reads the sources of the workspace around the current folder.
#[derive(Parser)]
#[command(name = "modules")]
struct Arguments {
    /// Only this crate, by its name or its folder.
    #[arg(long = "crate")]
    only: Option<String>,
    /// The circles of files and of folders only; exit code 1 if there is one of files.
    #[arg(long)]
    circles: bool,
    /// Writes the pictures of the workspace and of each crate into this folder.
    #[arg(long, conflicts_with_all = ["only", "circles"])]
    svg: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(code) => code,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<ExitCode, String> {
    let root = root_above(&std::env::current_dir().map_err(|error| error.to_string())?)
        .ok_or("no workspace here or above")?;
    if let Some(folder) = &arguments.svg {
        return write_pictures(&root, folder).map(|()| ExitCode::SUCCESS);
    }
    let mut packages = packages(&root)?;
    if let Some(name) = &arguments.only {
        packages.retain(|package| package.name == *name || package.folder == *name);
        if packages.is_empty() {
            return Err(format!("the workspace has no crate {name}"));
        }
    }
    let mut found = false;
    for package in packages {
        let files = package_graph(&root, &package)?;
        println!("== {}: {} files, {} edges", package.name, files.nodes.len(), files.edges.len());
        if arguments.circles {
            found |= print_circles(&files);
        } else {
            print_edges(&files);
        }
    }
    Ok(if found { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn write_pictures(root: &Path, folder: &Path) -> Result<(), String> {
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for (name, svg) in pictures(root)? {
        let file = folder.join(name);
        std::fs::write(&file, svg).map_err(|error| format!("{}: {error}", file.display()))?;
    }
    Ok(())
}

/// Whether there is a circle of files.
fn print_circles(files: &Graph) -> bool {
    let circles = files.describe_circles();
    let folders = folder_graph(files).describe_circles();
    print!("{circles}");
    if !folders.is_empty() {
        print!("folders, which the law is not about:\n{folders}");
    }
    !circles.is_empty()
}

fn print_edges(files: &Graph) {
    for (from, name) in files.nodes.iter().enumerate() {
        println!("{name}");
        let uses = files.edges.iter().filter(|((user, _), _)| *user == from);
        for ((_, to), place) in uses {
            println!("  {} (line {}: {})", files.nodes[*to], place.line, place.text);
        }
    }
}
