//! Finds the files of a series.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::data_set::DataSet;
use super::error::DicomError;
use super::file::DicomFile;
use super::image::Image;
use super::tag::*;
use crate::image::ImageError;

/// Series that a message lists.
const LISTED: usize = 8;

/// Storage classes of slices: CT, MR, PET, secondary capture and their enhanced forms. Without
/// pixels their files are cut short, not something else.
const SLICE_CLASSES: [&str; 9] = [
    "1.2.840.10008.5.1.4.1.1.2",
    "1.2.840.10008.5.1.4.1.1.2.1",
    "1.2.840.10008.5.1.4.1.1.2.2",
    "1.2.840.10008.5.1.4.1.1.4",
    "1.2.840.10008.5.1.4.1.1.4.1",
    "1.2.840.10008.5.1.4.1.1.4.4",
    "1.2.840.10008.5.1.4.1.1.7",
    "1.2.840.10008.5.1.4.1.1.128",
    "1.2.840.10008.5.1.4.1.1.130",
];

/// Extensions of files that must be DICOM.
const EXTENSIONS: [&str; 3] = ["dcm", "dicom", "ima"];

/// The files of one series, at least one, in the order of their names.
pub(super) struct Series {
    pub uid: String,
    pub directory: PathBuf,
    pub images: Vec<(PathBuf, Image)>,
}

/// Files of a directory that belong to one series.
struct Found {
    title: String,
    images: Vec<(PathBuf, Result<Image, ImageError>)>,
}

/// The series that a directory or a file in it stands for.
pub(super) fn series(path: &Path) -> Result<Series, ImageError> {
    let io_error = |source| ImageError::Io { path: path.into(), source };
    let is_directory = fs::metadata(path).map_err(io_error)?.is_dir();
    if is_directory {
        let mut found = scan(path)?;
        return match found.pop_first() {
            Some((uid, only)) if found.is_empty() => collect(uid, path, only),
            Some(first) => {
                found.insert(first.0, first.1);
                Err(several(path, &found).into())
            }
            None => Err(none(path)?.into()),
        };
    }
    let file = DicomFile::require(path)?;
    let data = file.data_set()?;
    data.require(SERIES)?;
    // So that the message is about this file, whatever its directory holds.
    Image::of(&file, &data)?;
    let uid = data.text(SERIES);
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    match scan(directory)?.remove(&uid) {
        Some(found) => collect(uid, directory, found),
        None => Err(DicomError::Changed { path: path.into() }.into()),
    }
}

fn collect(uid: String, directory: &Path, found: Found) -> Result<Series, ImageError> {
    let mut images = Vec::new();
    for (path, image) in found.images {
        images.push((path, image?));
    }
    Ok(Series { uid, directory: directory.into(), images })
}

/// The images of a directory by their series. What is no image is left out, with a warning.
fn scan(directory: &Path) -> Result<BTreeMap<String, Found>, ImageError> {
    let mut found: BTreeMap<String, Found> = BTreeMap::new();
    let (files, mut left_out) = (files(directory)?, 0);
    let count = files.len();
    for path in files {
        let Some(file) = open(&path)? else {
            left_out += 1;
            continue;
        };
        let data = file.data_set()?;
        if !is_image(&file, &data) {
            left_out += 1;
            continue;
        }
        data.require(SERIES)?;
        let image = Image::of(&file, &data);
        let title = format!("{} \"{}\"", data.text(MODALITY), data.text(SERIES_DESCRIPTION));
        let series =
            found.entry(data.text(SERIES)).or_insert_with(|| Found { title, images: vec![] });
        drop(data);
        series.images.push((path, image));
    }
    if left_out > 0 && left_out < count {
        let directory = directory.display();
        tracing::warn!("{directory}: {left_out} of {count} files are no DICOM images; left out");
    }
    Ok(found)
}

/// A DICOM file, or `None` for one that has neither its start nor its name.
fn open(path: &Path) -> Result<Option<DicomFile>, ImageError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    if extension.is_some_and(|extension| EXTENSIONS.contains(&extension.as_str())) {
        return DicomFile::require(path).map(Some);
    }
    DicomFile::open(path)
}

fn is_image(file: &DicomFile, data: &DataSet) -> bool {
    let pixels = [ROWS, PIXELS, FLOAT_PIXELS, DOUBLE_PIXELS];
    let class = data.text(SOP_CLASS);
    pixels.iter().any(|&tag| data.get(tag).is_some())
        || SLICE_CLASSES.contains(&class.as_str())
        || class.is_empty() && SLICE_CLASSES.contains(&file.storage_class.as_str())
}

/// The regular files of a directory by name, but for hidden ones.
fn files(directory: &Path) -> Result<Vec<PathBuf>, ImageError> {
    let io_error = |source| ImageError::Io { path: directory.into(), source };
    let mut files = Vec::new();
    for entry in fs::read_dir(directory).map_err(io_error)? {
        let path = entry.map_err(io_error)?.path();
        let hidden = path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'));
        // A link to nowhere is no file.
        if !hidden && fs::metadata(&path).is_ok_and(|metadata| metadata.is_file()) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn several(directory: &Path, found: &BTreeMap<String, Found>) -> DicomError {
    let mut list: Vec<String> = Vec::new();
    for (uid, series) in found.iter().take(LISTED) {
        let files = series.images.len();
        let example = series.images[0].0.file_name().unwrap_or_default().to_string_lossy();
        let title = &series.title;
        list.push(format!("SeriesInstanceUID {uid} ({title}, {files} files, as {example})"));
    }
    if found.len() > LISTED {
        list.push(format!("{} others", found.len() - LISTED));
    }
    let (path, count, list) = (directory.into(), found.len(), list.join(", "));
    DicomError::SeveralSeries { path, count, list }
}

fn none(directory: &Path) -> Result<DicomError, ImageError> {
    let files = files(directory)?;
    let mut other = 0;
    for path in &files {
        other += usize::from(open(path)?.is_some());
    }
    Ok(DicomError::NoImages { path: directory.into(), files: files.len(), other })
}
