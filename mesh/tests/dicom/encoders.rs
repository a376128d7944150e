//! Encoders written from the standards, as simple as they allow.

/// One frame in RLE: per byte of a pixel, highest first, runs and literals of PackBits.
pub fn rle(pixels: &[u32], bytes_per_pixel: usize) -> Vec<u8> {
    let mut header = vec![bytes_per_pixel as u32];
    let mut data = Vec::new();
    for byte in (0..bytes_per_pixel).rev() {
        header.push(64 + data.len() as u32);
        let plane: Vec<u8> = pixels.iter().map(|pixel| (pixel >> (8 * byte)) as u8).collect();
        for run in plane.chunk_by(|a, b| a == b) {
            for part in run.chunks(128) {
                match part.len() {
                    1 => data.extend([0, part[0]]),
                    n => data.extend([(257 - n) as u8, part[0]]),
                }
            }
        }
        // A byte that says nothing, and padding to even.
        data.push(0x80);
        data.resize(data.len().next_multiple_of(2), 0);
    }
    header.resize(16, 0);
    header.iter().flat_map(|word| word.to_le_bytes()).chain(data).collect()
}

/// RLE with literals alone.
pub fn rle_literal(pixels: &[u32], bytes_per_pixel: usize) -> Vec<u8> {
    let mut header = vec![bytes_per_pixel as u32];
    let mut data = Vec::new();
    for byte in (0..bytes_per_pixel).rev() {
        header.push(64 + data.len() as u32);
        for part in pixels.chunks(128) {
            data.push(part.len() as u8 - 1);
            data.extend(part.iter().map(|pixel| (pixel >> (8 * byte)) as u8));
        }
    }
    header.resize(16, 0);
    header.iter().flat_map(|word| word.to_le_bytes()).chain(data).collect()
}

/// One frame in JPEG lossless, process 14, selection value 1: each pixel's difference to its left
/// neighbour (the first of a row: to the one above), in a Huffman code of 5 bits per category.
///
/// Source: ITU-T T.81, annex H.
pub fn jpeg_lossless(pixels: &[u16], columns: u16, rows: u16, precision: u8) -> Vec<u8> {
    let mut bytes = vec![0xff, 0xd8];
    let mut segment = |marker: u8, content: &[u8]| {
        bytes.extend([0xff, marker]);
        bytes.extend((content.len() as u16 + 2).to_be_bytes());
        bytes.extend(content);
    };
    let [r, c] = [rows.to_be_bytes(), columns.to_be_bytes()];
    segment(0xc3, &[precision, r[0], r[1], c[0], c[1], 1, 1, 0x11, 0]);
    // Categories 0 to 16, all of 5 bits: the code of a category is its number.
    let mut table = vec![0, 0, 0, 0, 0, 17];
    table.resize(17, 0);
    table.extend(0..=16);
    segment(0xc4, &table);
    segment(0xda, &[1, 1, 0, 1, 0, 0]);
    let mut bits = Bits { bytes, buffer: 0, count: 0 };
    let width = usize::from(columns);
    for (index, &pixel) in pixels.iter().enumerate() {
        let prediction = match index {
            0 => 1 << (precision - 1),
            _ if index % width == 0 => pixels[index - width],
            _ => pixels[index - 1],
        };
        let difference = i32::from(pixel.wrapping_sub(prediction) as i16);
        let category = 32 - difference.unsigned_abs().leading_zeros();
        bits.put(category, 5);
        if category < 16 {
            // Negative differences count from the lowest of their category.
            let low = if difference < 0 { difference - 1 } else { difference };
            bits.put(low as u32 & ((1 << category) - 1), category);
        }
    }
    bits.end()
}

struct Bits {
    bytes: Vec<u8>,
    buffer: u64,
    count: u32,
}

impl Bits {
    fn put(&mut self, value: u32, count: u32) {
        self.buffer = self.buffer << count | u64::from(value);
        self.count += count;
        while self.count >= 8 {
            self.count -= 8;
            let byte = (self.buffer >> self.count) as u8;
            self.bytes.push(byte);
            if byte == 0xff {
                self.bytes.push(0);
            }
        }
    }

    fn end(mut self) -> Vec<u8> {
        self.put(0x7f, 7);
        self.bytes.extend([0xff, 0xd9]);
        self.bytes.resize(self.bytes.len().next_multiple_of(2), 0);
        self.bytes
    }
}
