//! Tables in NumPy arrays: structured, or two-dimensional with the columns x, y, z, level, 4, 5, ...

use super::cells::Cells;
use super::{ImportError, Request, table, text};
use crate::files;
use crate::npy::read_header;
use npyz::{DType, Endianness, NpyHeader, Order, TypeChar, TypeStr};
use std::path::Path;

/// The numbers of a column: the one of row r is at the byte `first + r * stride`.
struct Column {
    name: String,
    first: usize,
    stride: usize,
    number: Number,
}

/// A type of numbers.
#[derive(Clone, Copy)]
struct Number {
    kind: TypeChar,
    bytes: usize,
    big_endian: bool,
}

/// Reads a table.
///
/// # Errors
/// If the file cannot be read, is not an array of numbers, or is shorter or longer than its header states.
pub fn read(path: &Path, request: &Request) -> Result<Cells, ImportError> {
    let bytes = files::read(path)?;
    let (header, offset) = read_header(&bytes)
        .map_err(|error| ImportError::content(format!("has no npy header: {error}")))?;
    let data = &bytes[offset as usize..];
    let (rows, columns) = layout(&header, data.len())?;
    let names: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
    let value = |row: usize, column: usize| {
        let Column { first, stride, number, .. } = columns[column];
        number.read(&data[first + row * stride..][..number.bytes])
    };
    table::cells(&names, rows, &value, request)
}

/// Number of rows, and the columns of an array whose data have this number of bytes.
fn layout(header: &NpyHeader, bytes: usize) -> Result<(usize, Vec<Column>), ImportError> {
    let (rows, row_bytes, columns) = match (header.dtype(), header.shape()) {
        (DType::Plain(kind), &[rows, columns]) => plain(&kind, header.order(), rows, columns)?,
        (DType::Record(fields), &[rows]) => {
            let (mut columns, mut first) = (Vec::new(), 0);
            for field in fields {
                let DType::Plain(kind) = &field.dtype else {
                    return Err(ImportError::content(format!(
                        "its field {} is not a number",
                        field.name
                    )));
                };
                let number = Number::of(kind)?;
                columns.push(Column { name: field.name, first, stride: 0, number });
                first += number.bytes;
            }
            columns.iter_mut().for_each(|column| column.stride = first);
            (rows, first, columns)
        }
        (dtype, shape) => {
            return Err(ImportError::content(format!(
                "has type {} and shape {shape:?}: a table of cells is structured, or has rows and at least four columns",
                dtype.descr()
            )));
        }
    };
    let expected = u128::from(rows) * row_bytes as u128;
    if bytes as u128 != expected {
        return Err(ImportError::content(format!(
            "has {bytes} bytes of data, but its header implies {expected} ({rows} rows): it is incomplete or damaged"
        )));
    }
    Ok((rows as usize, columns))
}

/// Rows, bytes per row and columns of a two-dimensional array.
fn plain(
    kind: &TypeStr,
    order: Order,
    rows: u64,
    columns: u64,
) -> Result<(u64, usize, Vec<Column>), ImportError> {
    let number = Number::of(kind)?;
    let (Ok(columns), Ok(rows_there)) = (usize::try_from(columns), usize::try_from(rows)) else {
        return Err(ImportError::content("its header implies more data than a computer can hold"));
    };
    if !(4..=1000).contains(&columns) {
        return Err(ImportError::content(format!(
            "has {columns} columns, and x, y, z and level are four: it is not a table of cells"
        )));
    }
    let place = |c: usize| match order {
        Order::C => (c * number.bytes, columns * number.bytes),
        Order::Fortran => (c.saturating_mul(rows_there).saturating_mul(number.bytes), number.bytes),
    };
    let column = |(c, name): (usize, String)| {
        let (first, stride) = place(c);
        Column { name, first, stride, number }
    };
    let all = text::names(columns).into_iter().enumerate().map(column).collect();
    Ok((rows, columns * number.bytes, all))
}

impl Number {
    fn of(kind: &TypeStr) -> Result<Self, ImportError> {
        let bytes = kind.num_bytes().unwrap_or(0);
        let known = match kind.type_char() {
            TypeChar::Float => matches!(bytes, 4 | 8),
            TypeChar::Int | TypeChar::Uint => matches!(bytes, 1 | 2 | 4 | 8),
            _ => false,
        };
        if !known {
            return Err(ImportError::content(format!(
                "has type {kind}: convert it to float64 or to integers of at most 64 bits"
            )));
        }
        let big_endian = kind.endianness() == Endianness::Big;
        Ok(Self { kind: kind.type_char(), bytes, big_endian })
    }

    /// The number in these bytes, whose number is that of the type.
    fn read(&self, bytes: &[u8]) -> f64 {
        let mut word = [0; 8];
        word[..self.bytes].copy_from_slice(bytes);
        if self.big_endian {
            word[..self.bytes].reverse();
        }
        let unsigned = u64::from_le_bytes(word);
        let unused = 64 - 8 * self.bytes as u32;
        match (self.kind, self.bytes) {
            (TypeChar::Float, 4) => f64::from(f32::from_bits(unsigned as u32)),
            (TypeChar::Float, _) => f64::from_bits(unsigned),
            (TypeChar::Int, _) => ((unsigned << unused) as i64 >> unused) as f64,
            _ => unsigned as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::testing::file_of;
    use crate::lattice::Root;
    use crate::npy::header;
    use crate::word::Side;

    fn read_bytes(bytes: &[u8], sides: Option<&str>) -> Result<Cells, ImportError> {
        let root = Some(Root { origin: [0.0; 3], edge: 4.0 });
        let sides = sides.map(str::to_owned);
        read(file_of(bytes).path(), &Request { root, sides, ..Request::default() })
    }

    /// The two cells of every test below.
    const ROWS: [[i8; 5]; 2] = [[0, 2, -1, 1, 2], [2, 0, 0, 2, 1]];

    fn expected() -> Cells {
        let mut cells =
            Cells { root: Some(Root { origin: [0.0; 3], edge: 4.0 }), ..Cells::default() };
        cells.push([0.0, 2.0, -1.0], 2.0);
        cells.push([2.0, 0.0, 0.0], 1.0);
        cells
    }

    /// An array of these rows in one of NumPy's types and orders.
    fn array(
        descr: &str,
        columns: usize,
        fortran: bool,
        encode: impl Fn(i8) -> Vec<u8>,
    ) -> Vec<u8> {
        let mut bytes = header(descr, &format!("(2, {columns})"));
        if fortran {
            let text = String::from_utf8_lossy(&bytes[10..]).replace("False", "True ");
            bytes.splice(10.., text.bytes());
            (0..columns).for_each(|c| ROWS.iter().for_each(|row| bytes.extend(encode(row[c]))));
        } else {
            ROWS.iter()
                .for_each(|row| row[..columns].iter().for_each(|&v| bytes.extend(encode(v))));
        }
        bytes
    }

    #[test]
    fn every_type_and_order_gives_the_same_cells() {
        for fortran in [false, true] {
            let arrays = [
                array("<f8", 4, fortran, |v| f64::from(v).to_le_bytes().to_vec()),
                array(">f8", 4, fortran, |v| f64::from(v).to_be_bytes().to_vec()),
                array("<f4", 4, fortran, |v| f32::from(v).to_le_bytes().to_vec()),
                array("<i8", 4, fortran, |v| i64::from(v).to_le_bytes().to_vec()),
                array(">i4", 4, fortran, |v| i32::from(v).to_be_bytes().to_vec()),
                array("<i2", 4, fortran, |v| i16::from(v).to_le_bytes().to_vec()),
                array("|i1", 4, fortran, |v| v.to_le_bytes().to_vec()),
            ];
            for bytes in arrays {
                assert_eq!(read_bytes(&bytes, None).unwrap(), expected());
            }
        }
    }

    #[test]
    fn sides_are_a_named_field_or_a_numbered_column() {
        let sides = Some(vec![Side::Crossing, Side::Inside]);
        let plain = array("<f4", 5, false, |v| f32::from(v).to_le_bytes().to_vec());
        assert_eq!(read_bytes(&plain, Some("4")).unwrap().sides, sides);
        let text = "{'descr': [('level', '|u1'), ('x', '<f8'), ('y', '<f8'), ('z', '<f8'), ('body', '<i4')], \
                    'fortran_order': False, 'shape': (2,), }\n";
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        for [x, y, z, level, body] in ROWS {
            bytes.push(level as u8);
            [x, y, z].iter().for_each(|&v| bytes.extend(f64::from(v).to_le_bytes()));
            bytes.extend(i32::from(body).to_le_bytes());
        }
        let cells = read_bytes(&bytes, Some("body")).unwrap();
        assert_eq!(cells, Cells { sides, ..expected() });
    }

    #[test]
    fn damaged_arrays_are_one_sentence_each() {
        let good = array("<f8", 4, false, |v| f64::from(v).to_le_bytes().to_vec());
        let refused = |bytes: &[u8]| read_bytes(bytes, None).unwrap_err().to_string();
        assert!(
            refused(&good[..good.len() - 1])
                .contains("has 63 bytes of data, but its header implies 64")
        );
        assert!(refused(&good[..20]).contains("has no npy header"));
        assert!(refused(&header("<f8", "(4611686018427387904, 4)")).contains("can be counted"));
        assert!(
            refused(&header("<f8", "(1152921504606846976, 4)")).contains("incomplete or damaged")
        );
        assert!(refused(&header("<f8", "(2, 9223372036854775807)")).contains("columns"));
        assert!(refused(&header("<f8", "(8,)")).contains("at least four columns"));
        assert!(refused(&header("<c16", "(0, 4)")).contains("has type <c16"));
        assert!(refused(&header("<f8", "(2, 3)")).contains("has 3 columns"));
    }
}
