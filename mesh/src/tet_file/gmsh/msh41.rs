//! Sections of MSH 4.1: nodes and elements in blocks per entity, physical groups with entities.

use super::content::{Content, Material};
use super::scanner::Scanner;
use crate::tet_file::TetMeshError;

/// Bytes that the numbers of an item take at least: as text a digit and a blank each.
fn least(scanner: &Scanner, numbers: usize, binary: usize) -> usize {
    if scanner.is_text() { 2 * numbers } else { binary }
}

/// The physical tags of volumes; those of points, curves and surfaces are passed over.
pub(super) fn entities(scanner: &mut Scanner, content: &mut Content) -> Result<(), TetMeshError> {
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = scanner.size("a number of entities")?;
    }
    for (dimension, count) in counts.into_iter().enumerate() {
        let coordinates = if dimension == 0 { 3 } else { 6 };
        let bytes = least(scanner, coordinates + 2, 4 + 8 * coordinates + 8);
        scanner.claim("entities", count, bytes)?;
        for _ in 0..count {
            let entity = scanner.int("an entity tag")?;
            for _ in 0..coordinates {
                scanner.real("a finite bound")?;
            }
            let physical = tags(scanner, "physical tags")?;
            if dimension > 0 {
                tags(scanner, "bounding entities")?;
            }
            if let (3, Some(tag)) = (dimension, physical) {
                content.volumes.insert(entity, tag);
            }
        }
    }
    Ok(())
}

/// A count and as many integers; the first of them.
fn tags(scanner: &mut Scanner, what: &'static str) -> Result<Option<i64>, TetMeshError> {
    let count = scanner.size(what)?;
    scanner.claim(what, count, least(scanner, 1, 4))?;
    let mut first = None;
    for _ in 0..count {
        let tag = scanner.int(what)?;
        first.get_or_insert(tag);
    }
    Ok(first)
}

/// Number of blocks and of all items in them; the two extreme tags after them are passed over.
fn blocks(
    scanner: &mut Scanner,
    what: &'static str,
    bytes: usize,
) -> Result<(u64, u64), TetMeshError> {
    let blocks = scanner.size("a number of blocks")?;
    scanner.claim("blocks", blocks, least(scanner, 4, 3 * 4 + 8))?;
    let total = scanner.size("a count")?;
    scanner.claim(what, total, bytes)?;
    scanner.size("the smallest tag")?;
    scanner.size("the largest tag")?;
    Ok((blocks, total))
}

/// The header of a block: dimension, entity, type or parametric, number of items.
struct Block {
    dimension: i64,
    entity: i64,
}

impl Block {
    fn read(scanner: &mut Scanner) -> Result<Self, TetMeshError> {
        let dimension = scanner.int("a dimension")?;
        if !(0..=3).contains(&dimension) {
            return Err(scanner.syntax(format!("dimension {dimension}"), "0 to 3"));
        }
        Ok(Self { dimension, entity: scanner.int("an entity tag")? })
    }
}

/// Items of a block, no more than are left of those announced.
fn items(scanner: &mut Scanner, left: &mut u64) -> Result<u64, TetMeshError> {
    let count = scanner.size("a count")?;
    match left.checked_sub(count) {
        Some(rest) => *left = rest,
        None => {
            let want = format!("{left} at most, of the total announced");
            return Err(scanner.syntax(format!("{count} in a block"), want));
        }
    }
    Ok(count)
}

fn all_there(scanner: &Scanner, left: u64, what: &str) -> Result<(), TetMeshError> {
    if left == 0 {
        return Ok(());
    }
    Err(scanner.syntax(format!("{left} {what} fewer in the blocks"), "as many as announced"))
}

pub(super) fn nodes(scanner: &mut Scanner, content: &mut Content) -> Result<(), TetMeshError> {
    let bytes = least(scanner, 4, 8 + 3 * 8);
    let (blocks, mut left) = blocks(scanner, "nodes", bytes)?;
    let mut tags = Vec::new();
    for _ in 0..blocks {
        let block = Block::read(scanner)?;
        let parameters = match scanner.int("parametric")? {
            0 => 0,
            1 => block.dimension,
            other => return Err(scanner.syntax(format!("parametric {other}"), "0 or 1")),
        };
        let count = items(scanner, &mut left)?;
        tags.clear();
        for _ in 0..count {
            tags.push(scanner.size("a node tag")?);
        }
        for &tag in &tags {
            let x = scanner.point()?;
            for _ in 0..parameters {
                scanner.real("a finite parameter")?;
            }
            content.add_node(scanner, tag, x)?;
        }
    }
    all_there(scanner, left, "nodes")
}

pub(super) fn elements(scanner: &mut Scanner, content: &mut Content) -> Result<(), TetMeshError> {
    let bytes = least(scanner, 2, 2 * 8);
    let (blocks, mut left) = blocks(scanner, "elements", bytes)?;
    let mut nodes = Vec::new();
    for _ in 0..blocks {
        let block = Block::read(scanner)?;
        let kind = scanner.element()?;
        for _ in 0..items(scanner, &mut left)? {
            let tag = scanner.size("an element tag")?;
            nodes.clear();
            for _ in 0..kind.nodes {
                nodes.push(scanner.size("a node tag")?);
            }
            content.add_element(&kind, tag, &nodes, Material::Volume(block.entity));
        }
    }
    all_there(scanner, left, "elements")
}
