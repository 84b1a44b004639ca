//! Series with abscissas of their own in one plot: dots, and means of bins.

use super::page::{Plot, Role, Series, Style};
use super::thin::thin;

/// Dots of one series; more would only hide each other.
const DOTS: usize = 3000;
/// A bin needs this many points.
const FEWEST_IN_BIN: usize = 6;

/// Dots in ascending order, thinned.
pub(super) fn dots(mut points: Vec<(f64, f64)>) -> Vec<[f64; 3]> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    let (x, mut thinned) = thin(&x, &[y], DOTS);
    let y = thinned.swap_remove(0);
    x.into_iter().zip(y).map(|(x, y)| [x, y, 0.0]).collect()
}

/// Mean abscissa, mean ordinate and its standard deviation in at most `most` bins with equal numbers of points.
pub(super) fn bins(mut points: Vec<(f64, f64)>, most: usize) -> Vec<[f64; 3]> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let size = points.len().div_ceil(most).max(FEWEST_IN_BIN);
    let full = points.chunks(size).filter(|b| b.len() >= FEWEST_IN_BIN);
    full.map(|bin| {
        let n = bin.len() as f64;
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| bin.iter().map(f).sum::<f64>() / n;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let variance = mean(&|p| (p.1 - y).powi(2)) * n / (n - 1.0);
        [x, y, variance.sqrt()]
    })
    .collect()
}

/// Series with abscissas of their own, merged into one plot; a point is abscissa, ordinate and bar.
#[derive(Default)]
pub(super) struct Points {
    series: Vec<(String, Role, Style)>,
    points: Vec<(usize, [f64; 3])>,
}

impl Points {
    /// Adds a series.
    pub fn add(&mut self, label: &str, role: Role, style: Style, points: Vec<[f64; 3]>) {
        let index = self.series.len();
        self.series.push((label.to_owned(), role, style));
        self.points.extend(points.into_iter().map(|p| (index, p)));
    }

    /// A plot of all series; its labels are still to be set.
    pub fn plot(mut self) -> Plot {
        self.points.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        let column = |index: usize, part: usize| -> Vec<f64> {
            let value = |(i, p): &(usize, [f64; 3])| if *i == index { p[part] } else { f64::NAN };
            self.points.iter().map(value).collect()
        };
        let series = self.series.iter().enumerate();
        Plot {
            x: self.points.iter().map(|(_, p)| p[0]).collect(),
            series: series
                .map(|(index, (label, role, style))| Series {
                    label: label.clone(),
                    role: *role,
                    style: *style,
                    y: column(index, 1),
                    bar: if *style == Style::Bars {
                        column(index, 2)
                    } else {
                        Vec::new()
                    },
                })
                .collect(),
            ..Plot::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Points, Role, Style, bins, dots};

    #[test]
    fn bins_hold_mean_and_standard_deviation() {
        // Each bin of 10 holds as many +1 as −1 around 2: variance 10/9.
        let points = (0..120).rev().map(|k| {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            (f64::from(k), 2.0 + sign)
        });
        let bins = bins(points.collect(), 12);
        assert_eq!(bins.len(), 12);
        assert_eq!(bins[0][0], 4.5);
        let sd = (10.0_f64 / 9.0).sqrt();
        assert!(
            bins.iter()
                .all(|[_, y, s]| *y == 2.0 && (s - sd).abs() < 1e-12)
        );
    }

    #[test]
    fn few_points_make_no_bin_and_series_keep_their_own_abscissas() {
        assert!(bins(vec![(0.0, 1.0); 5], 12).is_empty());
        let mut points = Points::default();
        points.add("a", Role::Before, Style::Dots, dots(vec![(2.0, 20.0)]));
        points.add("b", Role::After, Style::Line, vec![[1.0, 10.0, 0.0]]);
        let plot = points.plot();
        assert_eq!(plot.x, [1.0, 2.0]);
        assert!(plot.series[0].y[0].is_nan() && plot.series[0].y[1] == 20.0);
        assert!(plot.series[1].y[0] == 10.0 && plot.series[1].y[1].is_nan());
    }
}
