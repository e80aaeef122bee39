//! Colours, dashes and markers of series, and the colour map of levels.

use plotters::style::RGBColor;

/// Distinguishable with every kind of colour vision (Okabe and Ito), the first ones also in grey.
pub const COLOURS: [[u8; 3]; 7] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [90, 90, 90],
];

/// Number of markers.
pub const MARKERS: usize = 6;

/// The colour of a style.
pub fn colour(style: usize) -> RGBColor {
    let [r, g, b] = COLOURS[style % COLOURS.len()];
    RGBColor(r, g, b)
}

/// A colour in the notation of SVG.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// Number of colours in the map.
pub const SHADES: usize = 24;

/// Cividis from its light to its dark end: it looks alike with and without deficiencies of colour vision, and larger
/// values are darker in grey too.
const CIVIDIS: [[u8; 3]; 7] = [
    [255, 234, 70],
    [211, 193, 100],
    [166, 157, 117],
    [124, 123, 120],
    [87, 92, 109],
    [35, 62, 108],
    [0, 32, 77],
];

/// The colour of a shade from 0 to [`SHADES`] - 1, interpolated in cividis.
pub fn shade(shade: usize) -> [u8; 3] {
    let position = shade.min(SHADES - 1) as f64 / (SHADES - 1) as f64 * (CIVIDIS.len() - 1) as f64;
    let lower = (position as usize).min(CIVIDIS.len() - 2);
    let fraction = position - lower as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(CIVIDIS[lower][i]), f64::from(CIVIDIS[lower + 1][i]));
        (a + (b - a) * fraction).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_values_are_darker_in_grey_too() {
        let grey = |[r, g, b]: [u8; 3]| {
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        let greys: Vec<f64> = (0..SHADES).map(|s| grey(shade(s))).collect();
        assert!(greys.windows(2).all(|w| w[0] > w[1] + 2.0), "{greys:?}");
        // The lightest shade differs from the white background.
        assert!(greys[0] < 235.0 && greys[SHADES - 1] < 40.0);
    }
}
