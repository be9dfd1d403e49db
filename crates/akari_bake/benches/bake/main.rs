mod mesh_files;
mod paper;
use glam::Vec3;
use akari_bake::fit::*;
fn cpu() -> f64 { let s = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap(); s.split_whitespace().next().unwrap().parse::<f64>().unwrap() * 1e-9 }

fn main() {
    let path = std::env::var("MESH").unwrap();
    let count: usize = std::env::var("COUNT").map_or(50, |c| c.parse().unwrap());
    let tol: f32 = std::env::var("TOL").map_or(0.0005, |c| c.parse().unwrap());
    let ptol: f64 = std::env::var("PTOL").map_or(0.0, |c| c.parse().unwrap());
    let mut m = mesh_files::read(std::path::Path::new(&path)).unwrap();
    let lo = m.positions.iter().copied().reduce(Vec3::min).unwrap();
    let hi = m.positions.iter().copied().reduce(Vec3::max).unwrap();
    let c = (lo + hi) * 0.5; let s = 1.0 / (hi - lo).max_element();
    for p in &mut m.positions { *p = (*p - c) * s; }
    let y = (lo.y - c.y) * s;
    let nv = m.positions.len();
    let mut normals = vec![Vec3::ZERO; nv];
    let mut tris: Vec<[Vec3;3]> = vec![];
    for t in &m.triangles { let [a,b,c] = t.map(|i| m.positions[i as usize]); let n=(b-a).cross(c-a); for &i in t { normals[i as usize]+=n; } tris.push([a,b,c]); }
    let q = |x: f32, z: f32| Vec3::new(x*2.0, y, z*2.0);
    tris.push([q(-1.,-1.), q(-1.,1.), q(1.,1.)]); tris.push([q(-1.,-1.), q(1.,1.), q(1.,-1.)]);
    let p = akari_bake::probe::build(&tris);
    let size = 64u32;
    let mut order: Vec<usize> = (0..nv).collect();
    order.sort_by_key(|&i| { let p = (m.positions[i] + 0.5) * 1023.0; let mut k = 0u32; for b in 0..10 { for a in 0..3 { k |= ((p[a] as u32) >> b & 1) << (3*b+a as u32); } } k });
    let mut masks = vec![];
    let t = cpu(); let mut cnt=0; let run: usize = std::env::var("RUN").map_or(1, |c| c.parse().unwrap());
    let mut i = 7usize;
    while cnt < count { if cnt % run == 0 { i = (i * 7919 + 13) % nv; } else { i = (i + 1) % nv; } let v = order[i]; let n = normals[v].normalize_or_zero(); if n == Vec3::ZERO { continue; }
        let o = (m.positions[v] + n * 1e-4).as_dvec3();
        masks.push(p.masks(o, n.as_dvec3(), size, 1e-5)); cnt+=1; }
    println!("rays {:.3} ms/sample", (cpu() - t)*1e3 / cnt as f64);
    let mut fitter = Fitter::new(FitSettings { tolerance: tol, max_depth: 48 });
    let t = cpu();
    let mut total = FitQuality::default();
    for m in masks.iter().flatten() { total.add(&fitter.measure(m)); }
    let dt = (cpu() - t);
    println!("ours: {:.3} ms leaves {:.1} wrong {:.5} abs {:.5}  lines/split {:.0} rows/line {:.1} ns/row {:.2}", dt*1e3/cnt as f64, total.leaves as f64/cnt as f64, total.misclassified as f64/total.texels as f64, total.absolute_error/total.texels as f64, fitter.stat_lines as f64/(total.leaves as f64 - 6.0*cnt as f64), fitter.stat_rows as f64/fitter.stat_lines as f64, dt*1e9/fitter.stat_rows as f64);
    if std::env::var("PAPER").is_ok() {
    for cared in [true, false] {
    let t = cpu();
    let mut r = paper::Outcome::default();
    let cntp = count.min(20);
    for m in masks[..cntp].iter().flatten() {
        let mut texels = vec![];
        for y in 0..size { for x in 0..size { let f = |i: u32| (2*i+1) as f64/size as f64 - 1.0;
            let v = m.get(x,y); if cared && v.is_none() { continue; }
            texels.push(paper::Texel { x: f(x), y: f(y), v: if v == Some(true) {1.0} else {0.0} }); } }
        paper::fit(&mut texels, ptol * (size*size) as f64, &mut r);
    }
    println!("paper cared={cared}: {:.3} ms leaves {:.1} wrong {:.5} abs {:.5}", (cpu() - t)*1e3/cntp as f64, r.leaves as f64/cntp as f64, r.misclassified as f64/r.texels as f64, r.absolute_error/r.texels as f64);
    }}
}
