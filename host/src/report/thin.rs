//! Fewer points without losing a peak.

/// Keeps the smallest and the largest value of every series in each of `most / 2` stretches, in the order in which
/// they occur; they stand at the ends of the stretch, so a monotone series keeps its shape exactly.
///
/// All series share the abscissa. At most `most` points remain.
pub(super) fn thin(x: &[f64], series: &[Vec<f64>], most: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
    if x.len() <= most {
        return (x.to_vec(), series.to_vec());
    }
    let count = (most / 2).max(1);
    let stretches = (0..count).map(|b| (b * x.len() / count, (b + 1) * x.len() / count));
    let abscissa = stretches
        .clone()
        .flat_map(|(low, high)| [x[low], x[high - 1]])
        .collect();
    let thinned = series
        .iter()
        .map(|y| {
            stretches
                .clone()
                .flat_map(|(low, high)| extremes(&y[low..high]))
                .collect()
        })
        .collect();
    (abscissa, thinned)
}

/// Smallest and largest value in the order in which they occur.
fn extremes(values: &[f64]) -> [f64; 2] {
    let (mut low, mut high) = (0, 0);
    for (k, v) in values.iter().enumerate() {
        if *v < values[low] || values[low].is_nan() {
            low = k;
        }
        if *v > values[high] || values[high].is_nan() {
            high = k;
        }
    }
    [values[low.min(high)], values[low.max(high)]]
}

#[cfg(test)]
mod tests {
    use super::thin;

    #[test]
    fn peaks_survive() {
        let x: Vec<f64> = (0..10_000).map(f64::from).collect();
        let mut y = vec![0.0; x.len()];
        (y[1234], y[8765]) = (5.0, -7.0);
        let (few, thinned) = thin(&x, &[y, x.clone()], 100);
        assert_eq!((few.len(), thinned[0].len()), (100, 100));
        assert!(thinned[0].contains(&5.0) && thinned[0].contains(&-7.0));
        assert_eq!(few, thinned[1]);
        assert!(few.is_sorted() && few[0] == 0.0 && few[99] == 9999.0);
    }

    #[test]
    fn short_series_stay_as_they_are() {
        let x = vec![0.0, 1.0, 2.0];
        assert_eq!(thin(&x, std::slice::from_ref(&x), 4), (x.clone(), vec![x]));
    }
}
