//! x
use akari_reference::*;
use akari_scene::Scene;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = Scene::load(a[1].as_ref()).unwrap();
    println!("{:?} cams {} polys {}", scene.warnings, scene.cameras.len(), akari_scene::light_polygons(&scene).iter().filter(|c| c.result.is_ok()).count());
    let o = Options { width: 128, height: 128, spp: a[2].parse().unwrap(), max_depth: a[3].parse().unwrap(), threads: Some(a[4].parse().unwrap()), ..Default::default() };
    let out = render(&scene, None, &o, &NoProgress).unwrap();
    let s = out.statistics;
    println!("{:?} {:?}", out.noise, s);
    println!("{:.3} Mrays/s, {:.3} ms/spp, non-finite {}", s.rays as f64/s.trace_time.as_secs_f64()/1e6, s.trace_time.as_secs_f64()*1e3/o.spp as f64, s.non_finite_samples);
    akari_scene::tonemap::write_png(a[5].as_ref(), &out.color, Default::default()).unwrap();
}
