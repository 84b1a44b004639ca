//! The `bristle` command.
use bristle::{identify::identify, model::Model, recording::Recording};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let m = Model::read(a[2].as_ref()).unwrap();
    let t0 = std::time::Instant::now();
    let r = Recording::read(a[1].as_ref(), &m.columns, m.motion).unwrap();
    eprintln!("read {:?}", t0.elapsed());
    let (b, i) = identify(&[r], &m).unwrap();
    eprintln!(
        "identify {:?} reach {} rows {}",
        t0.elapsed(),
        b.problem.windows[0].reach,
        b.problem.rows.len()
    );
    eprintln!("{:?} chi2 {}", i.fit, i.chi2);
    for (l, p) in i.model.labels().iter().zip(i.model.parameters()) {
        println!("{:?} {} = {:?} ± {:?}", l.effect, l.name, p.value, p.se);
    }
}
