//! Sections of MSH 2.2. Counts are text; in binary files, integers have four bytes.

use super::content::{Content, Material};
use super::scanner::Scanner;
use crate::tet_file::TetMeshError;

pub(super) fn nodes(scanner: &mut Scanner, content: &mut Content) -> Result<(), TetMeshError> {
    let count = scanner.line_count()?;
    scanner.claim("nodes", count, if scanner.is_text() { 8 } else { 4 + 3 * 8 })?;
    for _ in 0..count {
        let tag = scanner.natural("a node number")?;
        let x = scanner.point()?;
        content.add_node(scanner, tag, x)?;
    }
    Ok(())
}

pub(super) fn elements(scanner: &mut Scanner, content: &mut Content) -> Result<(), TetMeshError> {
    let count = scanner.line_count()?;
    // The shortest is a point without tags: number and node, and as text also type and tags.
    scanner.claim("elements", count, 8)?;
    let mut left = count;
    let mut nodes = Vec::new();
    while left > 0 {
        // As text, each element has a header of its own, which starts with its number.
        let mut number = 0;
        if scanner.is_text() {
            number = scanner.natural("an element number")?;
        }
        let kind = scanner.element()?;
        let follow = if scanner.is_text() { 1 } else { scanner.natural("a number of elements")? };
        if follow > left {
            let want = format!("{left} elements at most, of the {count} announced");
            return Err(scanner.syntax(format!("{follow} elements"), want));
        }
        let tags = scanner.natural("a number of tags")?;
        for _ in 0..follow {
            if !scanner.is_text() {
                number = scanner.natural("an element number")?;
            }
            let mut physical = 0;
            for tag in 0..tags {
                let value = scanner.int("a tag")?;
                if tag == 0 {
                    physical = value;
                }
            }
            nodes.clear();
            for _ in 0..kind.nodes {
                nodes.push(scanner.natural("a node number")?);
            }
            content.add_element(&kind, number, &nodes, Material::Tag(physical));
        }
        left -= follow;
    }
    Ok(())
}
