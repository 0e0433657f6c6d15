//! The register of everything that is ever drawn.
//!
//! Numbers are part of the data contract: never reused, never renumbered. A retired one stays, marked retired. Blocks of
//! 100 belong to one stage.

/// The stage that draws; a part of every address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum Stage {
    Plan = 0,
    Scene = 1,
    Drive = 2,
    Sweep = 3,
    Slam = 4,
    Cells = 5,
    Corpus = 6,
    Train = 7,
}

macro_rules! purposes {
    ($($(#[$doc:meta])* $name:ident = $number:literal, $key:literal;)*) => {
        /// What a draw is for: one number for each config key or effect.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u32)]
        pub enum Purpose { $($(#[$doc])* $name = $number,)* }

        impl Purpose {
            /// All purposes, in the order of the register.
            pub const ALL: &[Purpose] = &[$(Purpose::$name,)*];

            /// The dotted config key (or the effect's name) that this purpose draws for.
            pub fn key(self) -> &'static str {
                match self { $(Purpose::$name => $key,)* }
            }
        }
    };
}

purposes! {
    // Plan: 1-99
    Family = 1, "families";
    // Scene: 100-299
    GroundNoise = 100, "scene.ground.source.random";
    GroundRmsHeight = 101, "scene.ground.source.random.rms_height_m";
    GroundCorrelationLength = 102, "scene.ground.source.random.correlation_length_m";
    // Drive: 300-499
    // Sweep: 500-699
    SweepMountX = 500, "sweep.mount.x_m";
    SweepMountY = 501, "sweep.mount.y_m";
    SweepMountZ = 502, "sweep.mount.z_m";
    SweepMountYaw = 503, "sweep.mount.yaw_deg";
    SweepMountPitch = 504, "sweep.mount.pitch_deg";
    SweepMountRoll = 505, "sweep.mount.roll_deg";
    SweepRangeSigma = 510, "sweep.effects.range_noise.sigma_m";
    SweepRangeSigmaPerM = 511, "sweep.effects.range_noise.sigma_per_m";
    SweepBiasSigma = 512, "sweep.effects.range_bias_m";
    SweepDropoutRate = 513, "sweep.effects.dropout.rate";
    SweepDropoutGround = 514, "sweep.effects.dropout.ground_reflectance";
    SweepTiltSigma = 515, "sweep.effects.tilt_jitter_deg";
    SweepIntensityGround = 516, "sweep.effects.intensity.ground_reflectance";
    SweepIntensitySigma = 517, "sweep.effects.intensity.noise";
    /// Index: object id; the same draw for dropout and intensity, so that a dark rock is dark to both.
    SweepObjectReflectance = 600, "sweep.object_reflectance";
    /// Index: slot.
    SweepRangeNoise = 601, "sweep.range_noise";
    /// One draw a sweep.
    SweepBias = 602, "sweep.range_bias";
    /// Index: slot.
    SweepDropout = 603, "sweep.dropout";
    /// Index: line.
    SweepTilt = 604, "sweep.tilt_jitter";
    /// Index: slot.
    SweepIntensity = 605, "sweep.intensity";
    /// Index: slot, and slot * 19 + k for sub-ray k.
    SweepPatch = 606, "sweep.patch";
    SweepPatchSubRay = 607, "sweep.patch.sub_ray";
    SweepVolume = 608, "sweep.volume";
    SweepVolumeSubRay = 609, "sweep.volume.sub_ray";
    // Slam: 700-799
    // Cells: 800-899
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn law_numbers_and_keys_are_unique() {
        let mut numbers: Vec<u32> = Purpose::ALL.iter().map(|&p| p as u32).collect();
        let mut keys: Vec<&str> = Purpose::ALL.iter().map(|p| p.key()).collect();
        numbers.sort_unstable();
        keys.sort_unstable();
        assert!(numbers.windows(2).all(|w| w[0] != w[1]), "a purpose number is used twice");
        assert!(keys.windows(2).all(|w| w[0] != w[1]), "a purpose key is used twice");
    }
}
