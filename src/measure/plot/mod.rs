//! Pictures of speed against error: scatter plots on logarithmic axes, as SVG.

mod labels;
mod svg;

pub use svg::scatter;

/// A picture of one or more panels, one below the other, which share the meaning of colours and marks.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    /// Heading.
    pub title: String,
    /// What is along x, with its unit.
    pub x_label: String,
    /// What is along y, with its unit.
    pub y_label: String,
    /// The panels, top to bottom.
    pub panels: Vec<Panel>,
    /// What each mark means.
    pub legend: Vec<(Mark, String)>,
}

/// One pair of axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Heading.
    pub title: String,
    /// What is in it.
    pub points: Vec<Point>,
}

/// A measured choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Written beside the mark.
    pub label: String,
    /// Position along x, above 0, and the ends of its interval.
    pub x: [f64; 3],
    /// Position along y.
    pub y: Height,
    /// Number of the colour; equal numbers have equal colours.
    pub color: usize,
    /// Shape of the mark.
    pub mark: Mark,
}

/// A position along y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Height {
    /// A value above 0 and the ends of its interval.
    At(f64, [f64; 2]),
    /// Nothing was counted: the rate is below this, and may be 0. Drawn hollow, with an arrow down.
    Below(f64),
}

impl Height {
    fn value(self) -> f64 {
        match self {
            Self::At(value, _) | Self::Below(value) => value,
        }
    }
}

/// The shape of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A disc.
    Circle,
    /// An upright square.
    Square,
    /// A square on its corner.
    Diamond,
    /// What a hollow mark with an arrow says; for legends.
    Hollow,
}
