//! The denoiser: how much noise it takes away, that it never adds error, and what history and upsampling do.

use bevy_akari::prelude::*;
use bevy_akari_tests::denoise::*;

/// Pixels of a side of the test pictures.
const SIDE: u32 = 96;

#[test]
fn the_guided_method_cleans_and_never_harms() {
    for (name, depth) in [("roughness_map", 3), ("cornell", 4)] {
        let lab = Lab::new(name, SIDE, depth);
        let truth = lab.reference(1024);
        let settings = Denoise {
            history: 1,
            ..Denoise::default()
        };
        let Some(mut denoiser) = lab.denoiser("the_guided_method_cleans", settings) else {
            return;
        };
        for spp in [1, 4, 16, 64] {
            let input = lab.input(spp, u64::from(spp));
            let before = lab.mse(&input, &truth, |_| true);
            for kernel in Kernel::ALL {
                denoiser.set_settings(Denoise { kernel, ..settings });
                let output = filter(&mut denoiser, &input);
                let ratio = lab.mse(&output, &truth, |_| true) / before;
                println!("{name} {spp} spp {kernel:?}: {ratio:.4} of the input's error");
                assert!(ratio < 1.0, "{name}: {ratio} at {spp} spp");
            }
        }
    }
}
