//! d
use bristle::{diagnose::*, identify::*, model::Model, recording::Recording};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let m = Model::read(a[2].as_ref()).unwrap();
    let r = [Recording::read(a[1].as_ref(), &m.columns, m.motion).unwrap()];
    let t0 = std::time::Instant::now();
    let (b, i) = identify(&r, &m).unwrap();
    eprintln!("identify {:?}", t0.elapsed());
    let o = diagnose(&b, &i, &r, &|_| {}).unwrap();
    eprintln!("diagnose {:?}", t0.elapsed());
    println!("{}", serde_json::to_string_pretty(&o.diagnosis).unwrap());
}
