//! Finds the files of a series.

use std::collections::BTreeMap;
use std::fs;
use std::io;
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
    pub images: Vec<Image>,
}

/// Files of a directory that belong to one series.
struct Found {
    title: String,
    images: Vec<(PathBuf, Result<Image, ImageError>)>,
}

/// The series that a directory or a file in it stands for.
pub(super) fn series(path: &Path) -> Result<Series, ImageError> {
    let refuse = |error: DicomError| Err(ImageError::in_file(path)(error));
    if fs::metadata(path).map_err(ImageError::in_file(path))?.is_dir() {
        let mut found = scan(path)?;
        return match (found.pop_first(), found.len()) {
            (Some((uid, only)), 0) => collect(uid, path, only),
            (Some((uid, first)), _) => {
                found.insert(uid, first);
                refuse(several(&found))
            }
            (None, _) => refuse(none(path)?),
        };
    }
    let file = DicomFile::open(path)?;
    let data = file.data_set()?;
    data.require(SERIES).map_err(ImageError::in_file(path))?;
    // So that the message is about this file, whatever its directory holds.
    Image::of(&file, &data)?;
    let uid = data.text(SERIES);
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    match scan(directory)?.remove(&uid) {
        Some(found) => collect(uid, directory, found),
        None => refuse(DicomError::Changed),
    }
}

fn collect(uid: String, directory: &Path, found: Found) -> Result<Series, ImageError> {
    let images = found.images.into_iter().map(|(_, image)| image).collect::<Result<_, _>>()?;
    Ok(Series { uid, directory: directory.into(), images })
}

/// The images of a directory by their series. What is no image is left out, with a warning.
fn scan(directory: &Path) -> Result<BTreeMap<String, Found>, ImageError> {
    let mut found: BTreeMap<String, Found> = BTreeMap::new();
    let files = files(directory)?;
    let (count, mut images) = (files.len(), 0);
    for path in files {
        let Some(file) = open(&path)? else { continue };
        let data = file.data_set()?;
        if !is_image(&file, &data) {
            continue;
        }
        data.require(SERIES).map_err(ImageError::in_file(&path))?;
        let image = Image::of(&file, &data);
        let title = format!("{} \"{}\"", data.text(MODALITY), data.text(SERIES_DESCRIPTION));
        let series =
            found.entry(data.text(SERIES)).or_insert_with(|| Found { title, images: vec![] });
        series.images.push((path, image));
        images += 1;
    }
    if images > 0 && images < count {
        let (directory, left_out) = (directory.display(), count - images);
        tracing::warn!("{directory}: {left_out} of {count} files are no DICOM images; left out");
    }
    Ok(found)
}

/// A DICOM file, or `None` for one that has neither its start nor its name.
fn open(path: &Path) -> Result<Option<DicomFile>, ImageError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match DicomFile::open(path) {
        Err(error) if !EXTENSIONS.contains(&extension.as_str()) => match error.problem() {
            ImageError::Dicom(problem) if matches!(**problem, DicomError::NotDicom(_)) => Ok(None),
            _ => Err(error),
        },
        opened => opened.map(Some),
    }
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
    let list = || -> io::Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(directory)? {
            let entry = entry?;
            let hidden = entry.file_name().to_string_lossy().starts_with('.');
            // A link to nowhere is no file.
            if !hidden && fs::metadata(entry.path()).is_ok_and(|metadata| metadata.is_file()) {
                files.push(entry.path());
            }
        }
        files.sort();
        Ok(files)
    };
    list().map_err(ImageError::in_file(directory))
}

fn several(found: &BTreeMap<String, Found>) -> DicomError {
    let mut list: Vec<String> = Vec::new();
    for (uid, Found { title, images }) in found.iter().take(LISTED) {
        let files = images.len();
        let example = images[0].0.file_name().unwrap_or_default().to_string_lossy();
        list.push(format!("SeriesInstanceUID {uid} ({title}, {files} files, as {example})"));
    }
    if found.len() > LISTED {
        list.push(format!("{} others", found.len() - LISTED));
    }
    DicomError::SeveralSeries { count: found.len(), list: list.join(", ") }
}

fn none(directory: &Path) -> Result<DicomError, ImageError> {
    let files = files(directory)?;
    let mut other = 0;
    for path in &files {
        other += usize::from(open(path)?.is_some());
    }
    Ok(DicomError::NoImages { files: files.len(), other })
}
