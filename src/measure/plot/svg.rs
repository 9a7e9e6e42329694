//! Draws scatter plots: the one file that knows the crate plotters.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::labels::{self, Area, Line};
use super::{Height, Mark, Panel, Point, Scatter};

type Area2D<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Writing to a string cannot fail.
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

const WIDTH: u32 = 900;
const TITLE_HEIGHT: u32 = 40;
const PANEL_HEIGHT: u32 = 380;
const LEGEND_HEIGHT: u32 = 30;
/// From a panel's edges to its axes: left, top, right, bottom.
const MARGINS: [f64; 4] = [72.0, 30.0, 16.0, 46.0];

/// From the middle of a hollow mark to the tip of its arrow.
const ARROW: f64 = 13.0;

const INK: RGBColor = RGBColor(34, 34, 34);
const FAINT: RGBColor = RGBColor(225, 225, 225);
const AXIS: RGBColor = RGBColor(120, 120, 120);

/// Colours that people tell apart whatever their eyes (Okabe and Ito 2008), dark enough for text on white.
const COLORS: [RGBColor; 9] = [
    RGBColor(34, 34, 34),
    RGBColor(0, 98, 155),
    RGBColor(190, 80, 0),
    RGBColor(0, 120, 90),
    RGBColor(170, 70, 130),
    RGBColor(150, 115, 0),
    RGBColor(30, 130, 180),
    RGBColor(120, 60, 170),
    RGBColor(110, 110, 110),
];

/// Size of text in pixels, and the mean width of a letter of a sans-serif font in parts of it: wide ones such as
/// DejaVu take 0.58, Helvetica and Arial less.
const TEXT: f64 = 12.0;
const LETTER: f64 = 0.58;

/// Draws a picture and gives its SVG text. Points without a position (not finite, or not above 0) are left out.
pub fn scatter(plot: &Scatter) -> String {
    let height = TITLE_HEIGHT + PANEL_HEIGHT * plot.panels.len() as u32 + LEGEND_HEIGHT * legend_rows(plot);
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
        draw(plot, &root).expect("drawing into a string cannot fail");
    }
    text
}

fn draw(plot: &Scatter, root: &Area2D) -> Drawn {
    root.fill(&WHITE)?;
    write(root, &plot.title, [f64::from(WIDTH) / 2.0, 22.0], 16.0, HPos::Center, INK, false)?;
    for (number, panel) in plot.panels.iter().enumerate() {
        let top = f64::from(TITLE_HEIGHT + PANEL_HEIGHT * number as u32);
        draw_panel(plot, panel, root, top)?;
    }
    draw_legend(plot, root, f64::from(TITLE_HEIGHT + PANEL_HEIGHT * plot.panels.len() as u32))?;
    root.present()
}

/// A logarithmic axis: values from `low` to `high` onto pixels from `start` to `end`.
#[derive(Debug, Clone, Copy)]
struct LogAxis {
    low: f64,
    high: f64,
    start: f64,
    end: f64,
}

impl LogAxis {
    fn at(&self, value: f64) -> f64 {
        let share = (libm::log10(value) - libm::log10(self.low)) / (libm::log10(self.high) - libm::log10(self.low));
        self.start + share * (self.end - self.start)
    }

    /// Where lines go: powers of ten, and between them the more numbers the fewer powers there are.
    fn ticks(&self) -> Vec<f64> {
        let (first, last) = (libm::floor(libm::log10(self.low)) as i32, libm::ceil(libm::log10(self.high)) as i32);
        let factors: &[f64] = match self.high / self.low {
            ratio if ratio < 8.0 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            ratio if ratio < 1e3 => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        let all = (first..=last).flat_map(|power| factors.iter().map(move |f| f * libm::exp10(f64::from(power))));
        let slack = 1.0 + 1e-9;
        all.filter(|&tick| tick * slack >= self.low && tick <= self.high * slack).collect()
    }
}

fn drawable(point: &&Point) -> bool {
    let fine = |x: f64| x.is_finite() && x > 0.0;
    fine(point.x[0]) && fine(point.y.value())
}

fn draw_panel(plot: &Scatter, panel: &Panel, root: &Area2D, top: f64) -> Drawn {
    let points: Vec<&Point> = panel.points.iter().filter(drawable).collect();
    let frame =
        [MARGINS[0], top + MARGINS[1], f64::from(WIDTH) - MARGINS[2], top + f64::from(PANEL_HEIGHT) - MARGINS[3]];
    write(root, &panel.title, [frame[0], top + 16.0], 13.0, HPos::Left, INK, true)?;
    let (x_axis, y_axis) = axes(&points, frame);

    for tick in x_axis.ticks() {
        let x = x_axis.at(tick);
        line(root, [x, frame[1]], [x, frame[3]], FAINT)?;
        write(root, &number(tick), [x, frame[3] + 12.0], TEXT, HPos::Center, INK, false)?;
    }
    for tick in y_axis.ticks() {
        let y = y_axis.at(tick);
        line(root, [frame[0], y], [frame[2], y], FAINT)?;
        write(root, &number(tick), [frame[0] - 6.0, y], TEXT, HPos::Right, INK, false)?;
    }
    line(root, [frame[0], frame[3]], [frame[2], frame[3]], AXIS)?;
    line(root, [frame[0], frame[1]], [frame[0], frame[3]], AXIS)?;
    write(root, &plot.x_label, [0.5 * (frame[0] + frame[2]), frame[3] + 31.0], TEXT, HPos::Center, INK, false)?;
    write_upward(root, &plot.y_label, [16.0, 0.5 * (frame[1] + frame[3])])?;
    if points.is_empty() {
        let middle = [0.5 * (frame[0] + frame[2]), 0.5 * (frame[1] + frame[3])];
        return write(root, "nothing to show", middle, TEXT, HPos::Center, AXIS, false);
    }

    let marks: Vec<[f64; 2]> = points.iter().map(|point| [x_axis.at(point.x[0]), y_axis.at(point.y.value())]).collect();
    // Intervals: along x, along y, and the arrow of a mark that stands for "below".
    let mut bars: Vec<Line> = Vec::new();
    for (point, &[x, y]) in points.iter().zip(&marks) {
        let along = |value: f64| x_axis.at(value.clamp(x_axis.low, x_axis.high));
        let upright = |value: f64| y_axis.at(value.clamp(y_axis.low, y_axis.high));
        let vertical = match point.y {
            Height::At(_, [low, high]) => [[x, upright(low)], [x, upright(high)]],
            Height::Below(_) => [[x, y], [x, y + ARROW]],
        };
        let own = [[[along(point.x[1]), y], [along(point.x[2]), y]], vertical];
        for [from, to] in own {
            line(root, from, to, COLORS[point.color % COLORS.len()])?;
        }
        bars.extend(own);
    }
    let sizes: Vec<[f64; 2]> = points.iter().map(|point| [width(&point.label, TEXT), TEXT + 1.0]).collect();
    let inner = [frame[0] + 3.0, frame[1] + 2.0, frame[2] - 2.0, frame[3] - 3.0];
    let placed = labels::place(&marks, &sizes, &bars, inner);
    for ((point, &mark), label) in points.iter().zip(&marks).zip(&placed) {
        if label.distant {
            faint_line(root, mark, label.nearest(mark), COLORS[point.color % COLORS.len()])?;
        }
    }
    for ((point, &mark), label) in points.iter().zip(&marks).zip(&placed) {
        let color = COLORS[point.color % COLORS.len()];
        draw_mark(root, point.mark, mark, color, matches!(point.y, Height::Below(_)))?;
        let [left, top, _, bottom] = label.area;
        write(root, &point.label, [left, 0.5 * (top + bottom)], TEXT, HPos::Left, color, false)?;
    }
    Ok(())
}

/// Axes that hold all points with room for labels, at least a factor of 4 along x and three powers of ten along y.
fn axes(points: &[&Point], frame: Area) -> (LogAxis, LogAxis) {
    let range = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)))
    };
    let (x_low, x_high) = match range(&mut points.iter().map(|point| point.x[0])) {
        (low, high) if low <= high => (low / 1.25, high * 1.5),
        _ => (1.0, 10.0),
    };
    let middle = (x_low * x_high).sqrt();
    let (x_low, x_high) = (x_low.min(middle / 2.0), x_high.max(middle * 2.0));
    let (y_low, y_high) = match range(&mut points.iter().map(|point| point.y.value())) {
        (low, high) if low <= high => (low, high),
        _ => (1.0, 1e3),
    };
    // A power and a half of ten below the lowest: most choices get nothing wrong and stand there side by side.
    let (y_low, y_high) = (y_low / 30.0, (y_high * 4.0).max(y_low * 30.0));
    (
        LogAxis { low: x_low, high: x_high, start: frame[0], end: frame[2] },
        LogAxis { low: y_low, high: y_high, start: frame[3], end: frame[1] },
    )
}

fn draw_mark(root: &Area2D, mark: Mark, [x, y]: [f64; 2], color: RGBColor, hollow: bool) -> Drawn {
    const R: f64 = 4.5;
    if hollow || mark == Mark::Hollow {
        let tip = [x, y + ARROW];
        line(root, [x, y + R], tip, color)?;
        line(root, [x - 3.0, tip[1] - 3.5], tip, color)?;
        line(root, [x + 3.0, tip[1] - 3.5], tip, color)?;
    }
    let corners: Vec<[f64; 2]> = match mark {
        Mark::Circle | Mark::Hollow => Vec::new(),
        Mark::Square => vec![[x - 4.0, y - 4.0], [x + 4.0, y - 4.0], [x + 4.0, y + 4.0], [x - 4.0, y + 4.0]],
        Mark::Diamond => vec![[x, y - 6.0], [x + 6.0, y], [x, y + 6.0], [x - 6.0, y]],
    };
    let hollow = hollow || mark == Mark::Hollow;
    if corners.is_empty() {
        let fill = if hollow { WHITE } else { color };
        root.draw(&Circle::new(pixel([x, y]), R as i32 + 1, color.filled()))?;
        return if hollow { root.draw(&Circle::new(pixel([x, y]), R as i32 - 1, fill.filled())) } else { Ok(()) };
    }
    let shape = |scale: f64| corners.iter().map(|c| pixel([x + (c[0] - x) * scale, y + (c[1] - y) * scale])).collect();
    let outer: Vec<(i32, i32)> = shape(1.15);
    root.draw(&Polygon::new(outer, color.filled()))?;
    if hollow {
        let inner: Vec<(i32, i32)> = shape(0.65);
        root.draw(&Polygon::new(inner, WHITE.filled()))?;
    }
    Ok(())
}

/// How many rows the legend takes.
fn legend_rows(plot: &Scatter) -> u32 {
    legend_places(plot).last().map_or(0, |[_, row]| *row as u32 + 1)
}

/// Left end and row of every entry.
fn legend_places(plot: &Scatter) -> Vec<[f64; 2]> {
    let (mut x, mut row) = (MARGINS[0], 0.0);
    let place = |(_, text): &(Mark, String)| {
        let taken = 16.0 + width(text, TEXT) + 24.0;
        if x + taken > f64::from(WIDTH) && x > MARGINS[0] {
            (x, row) = (MARGINS[0], row + 1.0);
        }
        let place = [x, row];
        x += taken;
        place
    };
    plot.legend.iter().map(place).collect()
}

fn draw_legend(plot: &Scatter, root: &Area2D, top: f64) -> Drawn {
    for ((mark, text), [x, row]) in plot.legend.iter().zip(legend_places(plot)) {
        let y = top + 12.0 + row * f64::from(LEGEND_HEIGHT);
        draw_mark(root, *mark, [x, y], AXIS, *mark == Mark::Hollow)?;
        write(root, text, [x + 12.0, y], TEXT, HPos::Left, INK, false)?;
    }
    Ok(())
}

fn pixel([x, y]: [f64; 2]) -> (i32, i32) {
    (libm::round(x) as i32, libm::round(y) as i32)
}

fn line(root: &Area2D, from: [f64; 2], to: [f64; 2], color: RGBColor) -> Drawn {
    root.draw(&PathElement::new([pixel(from), pixel(to)], color.stroke_width(1)))
}

/// From a mark to its label.
fn faint_line(root: &Area2D, from: [f64; 2], to: [f64; 2], color: RGBColor) -> Drawn {
    root.draw(&PathElement::new([pixel(from), pixel(to)], color.mix(0.4).stroke_width(1)))
}

/// Width of a text in pixels, roughly and rather too much.
fn width(text: &str, size: f64) -> f64 {
    text.chars().count() as f64 * size * LETTER
}

fn write(root: &Area2D, text: &str, at: [f64; 2], size: f64, anchor: HPos, color: RGBColor, bold: bool) -> Drawn {
    root.draw(&Text::new(text.to_owned(), pixel(at), style(size, anchor, color, bold)))
}

fn write_upward(root: &Area2D, text: &str, at: [f64; 2]) -> Drawn {
    let style = style(TEXT, HPos::Center, INK, false).transform(FontTransform::Rotate270);
    root.draw(&Text::new(text.to_owned(), pixel(at), style))
}

fn style<'a>(size: f64, anchor: HPos, color: RGBColor, bold: bool) -> TextStyle<'a> {
    // The backend divides sizes by 1.24.
    let font =
        FontDesc::new(FontFamily::SansSerif, size * 1.24, if bold { FontStyle::Bold } else { FontStyle::Normal });
    TextStyle { font, color: color.to_backend_color(), pos: Pos::new(anchor, VPos::Center) }
}

/// A tick's number: `0.5`, `20`, or with a power of ten where that is shorter.
fn number(value: f64) -> String {
    if (1e-3..1e4).contains(&value) {
        return format!("{}", libm::round(value * 1e6) / 1e6);
    }
    let power = libm::floor(libm::log10(value) + 1e-9);
    let factor = libm::round(value / libm::exp10(power));
    if factor == 1.0 { format!("1e{power}") } else { format!("{factor}e{power}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> Scatter {
        let point = |label: &str, x: f64, y: Height, color, mark| Point {
            label: label.into(),
            x: [x, x * 0.97, x * 1.03],
            y,
            color,
            mark,
        };
        let points = vec![
            point("leaky <&>", 3.0, Height::At(1e8, [0.9e8, 1.1e8]), 1, Mark::Circle),
            point("tight", 2.5, Height::Below(3e4), 2, Mark::Square),
            point("tree", 4.5, Height::Below(3e4), 0, Mark::Diamond),
            point("nowhere", f64::NAN, Height::Below(3e4), 0, Mark::Diamond),
        ];
        Scatter {
            title: "Speed against error".into(),
            x_label: "million rays a second".into(),
            y_label: "wrong in 1e9".into(),
            panels: vec![Panel { title: "one".into(), points }, Panel { title: "empty".into(), points: Vec::new() }],
            legend: vec![(Mark::Circle, "padded".into()), (Mark::Hollow, "none seen".into())],
        }
    }

    #[test]
    fn labels_are_text_and_escaped_and_points_without_a_place_are_left_out() {
        let svg = scatter(&plot());
        assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"));
        for text in ["leaky &lt;&amp;&gt;", "tight", "Speed against error", "nothing to show", "none seen", "1e8"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("nowhere") && !svg.contains("NaN"));
    }

    #[test]
    fn ticks_are_short() {
        let texts: Vec<String> = [0.5, 20.0, 1e4, 1e9, 5e-5, 1e-12].into_iter().map(number).collect();
        assert_eq!(texts, ["0.5", "20", "1e4", "1e9", "5e-5", "1e-12"]);
        let axis = LogAxis { low: 1.0, high: 10.0, start: 0.0, end: 1.0 };
        assert_eq!(axis.ticks(), [1.0, 2.0, 5.0, 10.0]);
        assert_eq!(LogAxis { high: 3.0, ..axis }.ticks(), [1.0, 1.5, 2.0, 3.0]);
        assert_eq!(axis.at(10.0), 1.0);
    }
}
