//! What stands between reflectors, lamps and pixels holds light back, whether it reflects or not.

use akari_scene::Scene;
use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_akari::interreflection::EFFECT;
use bevy_akari::interreflection::casters::Casters;
use bevy_akari::prelude::*;
use bevy_akari_tests::room::{Light, Room, bias_and_error};

/// Side of the pictures.
const SIDE: u32 = 32;
/// Path segments of light that bounced once.
const ONE_BOUNCE: u32 = 3;
/// Triangles of a box, of a floor and a wall.
const TRIANGLES: u32 = 12 + 2 + 2;

/// A floor and a wall that reflect, and a black screen between them and the lamp that does not.
struct Screened {
    room: Room,
    screen: Entity,
}

impl Screened {
    fn new(test: &str) -> Option<Self> {
        let blacken = |scene: &mut Scene| {
            // The darkest one is the screen's.
            let screen = (scene.materials.iter_mut())
                .filter(|material| material.emission.max_element() <= 0.0)
                .min_by(|a, b| a.base_color.x.total_cmp(&b.base_color.x))
                .expect("a scene with materials");
            screen.base_color = Vec4::W;
        };
        let mut room = Room::of_bounces(test, "corner_screen", SIDE, 1024, ONE_BOUNCE, blacken)?;
        let world = room.headless.app.world_mut();
        let bodies: Vec<_> = world
            .query::<(Entity, &MeshMaterial3d<StandardMaterial>)>()
            .iter(world)
            .map(|(entity, material)| (entity, material.id()))
            .collect();
        let materials = world.resource::<Assets<StandardMaterial>>();
        let (mut screen, mut reflecting) = (None, Vec::new());
        for (entity, material) in bodies {
            let material = materials.get(material).expect("it was spawned");
            if material.emissive.to_vec3() != Vec3::ZERO {
                continue;
            }
            if material.base_color.to_linear().to_vec3() == Vec3::ZERO {
                screen = Some(entity);
            } else {
                reflecting.push(entity);
            }
        }
        assert_eq!(reflecting.len(), 2, "a floor and a wall");
        for body in reflecting {
            world.entity_mut(body).insert(Reflector);
        }
        Some(Self {
            room,
            screen: screen.expect("a screen"),
        })
    }

    fn bounced(&mut self) -> Light {
        self.room.step(1);
        self.room.indirect()
    }

    /// Bias and relative RMSE against the path tracer.
    fn measure(&mut self, what: &str) -> (f64, f64) {
        let light = self.bounced();
        let (bias, error) = bias_and_error(&light, &self.room.truth, |_| true);
        println!(
            "{what}: energy {:+.1} %, relative RMSE {:.1} %",
            100.0 * bias,
            100.0 * error
        );
        (bias, error)
    }

    fn reason(&self) -> String {
        let report = self.room.headless.app.world().resource::<EffectReport>();
        report
            .get(EFFECT)
            .map_or_else(String::new, |state| state.reason.clone())
    }

    fn hiding_triangles(&self) -> u64 {
        let counters = self.room.headless.ledger().counters();
        let name = "interreflection triangles that hide";
        counters.get(name).copied().unwrap_or(0)
    }

    fn bytes(&self) -> u64 {
        let bytes = self.room.headless.ledger().bytes_by_effect();
        bytes.get(EFFECT).copied().unwrap_or(0)
    }

    fn world(&mut self) -> &mut World {
        self.room.headless.app.world_mut()
    }
}

#[test]
fn what_does_not_reflect_hides_light_too() {
    let Some(mut scene) = Screened::new("what_does_not_reflect") else {
        return;
    };
    let rays = |shadow_rays| Interreflection {
        shadow_rays,
        ..Interreflection::default()
    };
    scene.room.set(rays(3));
    let (_, error) = scene.measure("all opaque meshes hide light");
    let hidden = scene.bounced();
    assert_eq!(scene.hiding_triangles(), u64::from(TRIANGLES));
    assert!(scene.reason().ends_with("occlusion: opaque meshes"));

    // One triangle too many.
    scene.world().insert_resource(MostBlockers(TRIANGLES - 1));
    let (bias_alone, error_alone) = scene.measure("reflectors alone hide light");
    let alone = scene.bounced();
    let reason = scene.reason();
    assert!(
        reason.ends_with("reflectors alone, since 16 triangles are more than 15"),
        "{reason}"
    );
    assert_eq!(scene.hiding_triangles(), 4);
    scene.world().insert_resource(MostBlockers::default());

    // Penumbrae of few rays between corners of patches.
    let limit = 0.10;
    assert!(error <= limit, "{error}");
    assert!(
        error_alone > 2.0 * limit && bias_alone > 0.1,
        "without the screen it passes, too: {error_alone}"
    );

    // Bevy's own mark says the same of the screen.
    let screen = scene.screen;
    scene.world().entity_mut(screen).insert(NotShadowCaster);
    assert_eq!(scene.bounced(), alone);
    scene.world().entity_mut(screen).remove::<NotShadowCaster>();
    assert_eq!(scene.bounced(), hidden);

    // It hides where it is, as it moves.
    let place = |scene: &mut Screened, shift: Vec3| {
        let mut screen = scene.world().entity_mut(screen);
        let mut transform = screen.get_mut::<Transform>().expect("it has a place");
        transform.translation += shift;
    };
    place(&mut scene, Vec3::Y * 50.0);
    let without = scene.bounced();
    let albedo = scene.room.surfaces.albedo.clone();
    // Where the picture showed it, it shows what was behind it.
    let beside = |i: usize| albedo[i] != [0.0; 3];
    let (_, apart) = bias_and_error(&without, &alone, beside);
    assert!(apart < 1e-3, "above all it hides nothing: {apart}");
    place(&mut scene, Vec3::NEG_Y * 50.0);
    assert_eq!(scene.bounced(), hidden);

    // Nothing is kept for rays that are not sent.
    let with_rays = scene.bytes();
    scene.room.set(rays(0));
    scene.bounced();
    assert!(scene.reason().ends_with("occlusion: none"));
    assert_eq!(scene.hiding_triangles(), 0);
    assert!(scene.bytes() < with_rays);
    assert_eq!(scene.world().resource::<Casters>().blockers().count(), 0);
}
