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
    // Slam: 700-799
    /// Index 6 i + k: component k of particle i.
    SlamSample = 700, "slam.fastslam.sample";
    SlamResample = 701, "slam.fastslam.resample";
    /// Index k: component k of the pose.
    SlamSurrogate = 702, "slam.surrogate";
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
