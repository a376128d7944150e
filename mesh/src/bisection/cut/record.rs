//! What the forest keeps of cuts.

use std::collections::{BTreeMap, BTreeSet};

use super::fine::FineFace;
use crate::bisection::delta::TetId;
use crate::bisection::diamond::TetRecord;
use crate::bisection::label_tree::NodeRef;

/// A face that is to be severed or closed, and the leaves on both sides of it; one leaf twice if it is inside of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Severed {
    /// The face.
    pub face: FineFace,
    /// The leaves, by their own numbers.
    pub leaves: [TetId; 2],
}

/// A leaf in several sheets.
#[derive(Clone, Debug)]
pub(crate) struct Torn {
    /// Its content before.
    pub whole: NodeRef,
    /// The numbers of its sheets, by part; the leaf's own is one of them.
    pub sheets: Vec<u32>,
    /// The part of each of its finest tetrahedra.
    pub part_of: Vec<u16>,
}

/// A sheet beyond its leaf's own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sheet {
    pub leaf: u32,
    pub record: TetRecord,
}

/// Severed faces, and what follows from them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cuts {
    /// Each with the leaves on both sides of it.
    pub(super) severed: BTreeMap<FineFace, [u32; 2]>,
    /// Leaves in which, or around which, material that nothing joins is apart.
    pub(super) apart: BTreeSet<u32>,
    /// Leaves with severed faces in them or on them.
    pub(super) frozen: BTreeSet<u32>,
    pub(super) torn: BTreeMap<u32, Torn>,
    /// Sheets beyond leaves' own, by their numbers.
    pub(super) sheets: BTreeMap<u32, Sheet>,
    /// Numbers for further sheets: places of diamonds that nothing else uses.
    pub(super) free_numbers: Vec<u32>,
    /// Contents of parts that a cut now under way has changed.
    pub(super) left: Vec<NodeRef>,
}

impl Cuts {
    /// Whether it holds nothing.
    #[inline]
    pub fn are_none(&self) -> bool {
        self.frozen.is_empty() && self.apart.is_empty()
    }

    /// Whether a leaf joins others by its material alone: its faces are severed, or it is one that was taken apart.
    #[inline]
    pub fn marks(&self, leaf: u32) -> bool {
        !self.are_none() && (self.frozen.contains(&leaf) || self.apart.contains(&leaf))
    }

    /// Has the halves of a leaf that joins others by its material alone do that as well.
    #[inline]
    pub fn split(&mut self, leaf: u32, halves: [u32; 2]) {
        if !self.apart.is_empty() && self.apart.contains(&leaf) {
            self.apart.extend(halves);
        }
    }

    /// Has a leaf take the place of halves that go.
    #[inline]
    pub fn merge(&mut self, leaf: u32, halves: [u32; 2]) {
        if !self.apart.is_empty() && halves.map(|half| self.apart.remove(&half)).contains(&true) {
            self.apart.insert(leaf);
        }
    }

    /// A leaf that is in several sheets.
    pub fn torn(&self, leaf: u32) -> Option<&Torn> {
        self.torn.get(&leaf)
    }

    /// Whether a leaf has to stay as it is.
    #[inline]
    pub fn freezes(&self, leaf: u32) -> bool {
        !self.are_none() && (self.frozen.contains(&leaf) || self.torn.contains_key(&leaf))
    }

    /// A sheet beyond its leaf's own.
    #[inline]
    pub fn sheet(&self, number: u32) -> Option<&Sheet> {
        if self.sheets.is_empty() { None } else { self.sheets.get(&number) }
    }

    /// All of these, ascending numbers.
    pub fn sheets(&self) -> impl Iterator<Item = (u32, &Sheet)> {
        self.sheets.iter().map(|(&number, sheet)| (number, sheet))
    }
}
