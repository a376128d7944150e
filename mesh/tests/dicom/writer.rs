//! Series written by the test through `dicom-object`, in any transfer syntax.

use std::path::{Path, PathBuf};

use dicom_core::value::{DataSetSequence, PixelFragmentSequence, PrimitiveValue};
use dicom_core::{DataElement, DicomValue, Tag, VR};
use dicom_object::{FileMetaTableBuilder, InMemDicomObject};
use nalgebra::Vector3;
use tempfile::TempDir;

pub const IMPLICIT: &str = "1.2.840.10008.1.2";
pub const EXPLICIT: &str = "1.2.840.10008.1.2.1";
pub const DEFLATED: &str = "1.2.840.10008.1.2.1.99";
pub const BIG_ENDIAN: &str = "1.2.840.10008.1.2.2";
pub const RLE: &str = "1.2.840.10008.1.2.5";
pub const JPEG_BASELINE: &str = "1.2.840.10008.1.2.4.50";
pub const JPEG_LOSSLESS: &str = "1.2.840.10008.1.2.4.70";
pub const JPEG_2000: &str = "1.2.840.10008.1.2.4.90";

pub const CT: &str = "1.2.840.10008.5.1.4.1.1.2";

pub const SOP_CLASS: Tag = Tag(0x0008, 0x0016);
pub const SERIES: Tag = Tag(0x0020, 0x000e);
pub const POSITION: Tag = Tag(0x0020, 0x0032);
pub const ORIENTATION: Tag = Tag(0x0020, 0x0037);
pub const SAMPLES: Tag = Tag(0x0028, 0x0002);
pub const PHOTOMETRIC: Tag = Tag(0x0028, 0x0004);
pub const FRAMES: Tag = Tag(0x0028, 0x0008);
pub const ROWS: Tag = Tag(0x0028, 0x0010);
pub const COLUMNS: Tag = Tag(0x0028, 0x0011);
pub const SPACING: Tag = Tag(0x0028, 0x0030);
pub const ALLOCATED: Tag = Tag(0x0028, 0x0100);
pub const STORED: Tag = Tag(0x0028, 0x0101);
pub const HIGH_BIT: Tag = Tag(0x0028, 0x0102);
pub const SIGNED: Tag = Tag(0x0028, 0x0103);
pub const INTERCEPT: Tag = Tag(0x0028, 0x1052);
pub const SLOPE: Tag = Tag(0x0028, 0x1053);
pub const PIXELS: Tag = Tag(0x7fe0, 0x0010);

/// A data set under construction.
#[derive(Clone)]
pub struct File {
    pub object: InMemDicomObject,
    pub syntax: &'static str,
}

impl File {
    /// A CT slice of 2 × 2 mm pixels at z = 2 `index` mm: 16 bits, signed, not scaled.
    pub fn slice(index: i32, columns: u16, rows: u16, pixels: &[i16]) -> Self {
        assert_eq!(pixels.len(), usize::from(columns) * usize::from(rows));
        Self { object: InMemDicomObject::new_empty(), syntax: EXPLICIT }
            .text(SOP_CLASS, VR::UI, CT)
            .text(Tag(0x0008, 0x0060), VR::CS, "CT")
            .text(Tag(0x0010, 0x0010), VR::PN, "Nobody")
            .text(SERIES, VR::UI, "1.2.3")
            // Neither the names nor these numbers give the order.
            .text(Tag(0x0020, 0x0013), VR::IS, &format!("{}", (index * 7 + 3) % 11))
            .text(POSITION, VR::DS, &format!("0\\0\\{}", 2 * index))
            .text(ORIENTATION, VR::DS, "1\\0\\0\\0\\1\\0")
            .number(SAMPLES, 1)
            .text(PHOTOMETRIC, VR::CS, "MONOCHROME2")
            .number(ROWS, rows)
            .number(COLUMNS, columns)
            .text(SPACING, VR::DS, "2\\2")
            // Slices overlap: their thickness is not their spacing.
            .text(Tag(0x0018, 0x0050), VR::DS, "5")
            .bits(16, 16, 15, true)
            .words(pixels)
    }

    pub fn put(mut self, tag: Tag, vr: VR, value: impl Into<PrimitiveValue>) -> Self {
        self.object.put(DataElement::new(tag, vr, value.into()));
        self
    }

    pub fn text(self, tag: Tag, vr: VR, text: &str) -> Self {
        self.put(tag, vr, text)
    }

    pub fn number(self, tag: Tag, number: u16) -> Self {
        self.put(tag, VR::US, PrimitiveValue::from(number))
    }

    pub fn bits(self, allocated: u16, stored: u16, high: u16, signed: bool) -> Self {
        self.number(ALLOCATED, allocated)
            .number(STORED, stored)
            .number(HIGH_BIT, high)
            .number(SIGNED, signed.into())
    }

    pub fn words(self, pixels: &[i16]) -> Self {
        let words: Vec<u16> = pixels.iter().map(|&pixel| pixel as u16).collect();
        self.put(PIXELS, VR::OW, PrimitiveValue::U16(words.into()))
    }

    pub fn bytes_of_pixels(self, vr: VR, pixels: Vec<u8>) -> Self {
        self.put(PIXELS, vr, PrimitiveValue::U8(pixels.into()))
    }

    pub fn fragments(self, syntax: &'static str, fragments: Vec<Vec<u8>>) -> Self {
        self.offsets(syntax, vec![], fragments)
    }

    pub fn offsets(
        mut self,
        syntax: &'static str,
        offsets: Vec<u32>,
        fragments: Vec<Vec<u8>>,
    ) -> Self {
        let value = PixelFragmentSequence::new(offsets, fragments);
        self.object.put(DataElement::new(PIXELS, VR::OB, DicomValue::from(value)));
        Self { syntax, ..self }
    }

    pub fn sequence(mut self, tag: Tag, items: Vec<InMemDicomObject>) -> Self {
        self.object.put(DataElement::new(tag, VR::SQ, DataSetSequence::from(items)));
        self
    }

    pub fn without(mut self, tag: Tag) -> Self {
        self.object.remove_element(tag);
        self
    }

    pub fn syntax(self, syntax: &'static str) -> Self {
        Self { syntax, ..self }
    }

    pub fn series(self, uid: &str) -> Self {
        self.text(SERIES, VR::UI, uid)
    }

    /// The file as it is stored.
    pub fn bytes(&self) -> Vec<u8> {
        let meta = FileMetaTableBuilder::new()
            .transfer_syntax(self.syntax)
            .media_storage_sop_class_uid(CT)
            .media_storage_sop_instance_uid("1.2.3.4");
        let mut bytes = Vec::new();
        let file = self.object.clone().with_meta(meta).unwrap();
        file.write_all(&mut bytes).unwrap();
        bytes
    }
}

/// An item of a sequence, or a group of one item in it.
pub fn item(elements: Vec<(Tag, &str)>) -> InMemDicomObject {
    InMemDicomObject::from_element_iter(
        elements.into_iter().map(|(tag, text)| DataElement::new(tag, VR::DS, text)),
    )
}

/// A sequence of one item.
pub fn group(tag: Tag, item: InMemDicomObject) -> DataElement<InMemDicomObject> {
    DataElement::new(tag, VR::SQ, DataSetSequence::from(vec![item]))
}

/// Files in a folder of their own.
pub struct Folder(TempDir);

impl Folder {
    pub fn new(files: &[(&str, Vec<u8>)]) -> Self {
        let folder = Self(TempDir::new().unwrap());
        for (name, bytes) in files {
            std::fs::write(folder.file(name), bytes).unwrap();
        }
        folder
    }

    /// Slices under names whose order says nothing.
    pub fn of(slices: &[File]) -> Self {
        let count = slices.len();
        // Multiplying by 7 permutes where 7 does not divide the count.
        assert!(!count.is_multiple_of(7));
        let name = |i: usize| format!("IM{:04}", i * 7 % count);
        let files: Vec<(String, Vec<u8>)> =
            slices.iter().enumerate().map(|(i, slice)| (name(i), slice.bytes())).collect();
        let files: Vec<(&str, Vec<u8>)> =
            files.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
        Self::new(&files)
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }
}

/// Numbers as a DICOM value of decimals.
pub fn decimals(numbers: &[f64]) -> String {
    numbers.iter().map(|x| format!("{x:.10}")).collect::<Vec<_>>().join("\\")
}

pub fn vector(v: Vector3<f64>) -> String {
    decimals(&[v.x, v.y, v.z])
}
