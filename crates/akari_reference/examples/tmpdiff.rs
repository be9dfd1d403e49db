//! x
use akari_reference::*;
use akari_scene::{Scene, exr_io::*};
fn main() {
    let f = std::path::PathBuf::from("/work/shared/data/reference/occluder");
    let scene = Scene::load(&f.join("scene.glb")).unwrap();
    println!("{:?}", scene.warnings);
    for (no, name) in [
        (true, "ref_direct_center_unshadowed_hc.exr"),
        (false, "ref_direct_center_hc.exr"),
    ] {
        let spp: u32 = std::env::args().nth(1).map_or(64, |s| s.parse().unwrap());
        let o = Options {
            width: 256,
            height: 256,
            spp,
            max_depth: 2,
            pixel_centers: true,
            no_occlusion: no,
            aovs: true,
            ..Default::default()
        };
        let out = render(&scene, None, &o, &NoProgress).unwrap();
        let e = read_rgb(&f.join(name)).unwrap();
        let m = read_rgb(&f.join("mask_interior.exr")).unwrap();
        println!("{:?}", metrics::compare(&out.color, &e, Some(&m)).unwrap());
        println!("{:?} {:?}", out.noise, out.statistics);
        let a = out.aovs.unwrap();
        // by roughness & albedo class
        let mut classes: std::collections::BTreeMap<String, (f64, f64, f64, f64, u32)> =
            Default::default();
        let mut worst: Vec<(f32, usize)> = vec![];
        for i in 0..e.data.len() {
            if m.data[i][0] < 0.5 {
                continue;
            }
            let (x, y) = (out.color.data[i][0], e.data[i][0]);
            let c = classes
                .entry(format!("{:?} r{}", a.albedo[i], a.roughness[i]))
                .or_default();
            c.0 += ((x - y) * (x - y)) as f64;
            c.1 += (y * y) as f64;
            c.2 += x as f64;
            c.3 += y as f64;
            c.4 += 1;
            worst.push(((x - y).abs(), i));
        }
        for (k, c) in classes {
            println!(
                "{k}: rel_rmse {:.4} bias {:+.5} n {}",
                (c.0 / c.1).sqrt(),
                c.2 / c.3 - 1.0,
                c.4
            );
        }
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (d, i) in &worst[..25] {
            println!(
                "{} {} d {d} ours {:?} mitsuba {:?} pos {:?} alb {:?} r {}",
                i % 256,
                i / 256,
                out.color.data[*i],
                e.data[*i],
                a.position[*i],
                a.albedo[*i],
                a.roughness[*i]
            );
        }
    }
}
