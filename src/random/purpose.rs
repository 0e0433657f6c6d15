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

            /// Whether the values are whole numbers: those of the keys named `count`.
            pub fn counts(self) -> bool {
                self.key().ends_with(".count")
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
    GroundFeatureCount = 103, "scene.ground.features.count";
    GroundFeatureHeight = 104, "scene.ground.features.height_m";
    GroundFeatureWidth = 105, "scene.ground.features.width_m";
    GroundFeatureLength = 106, "scene.ground.features.length_m";
    GroundFeaturePlace = 107, "scene.ground.features";
    GroundFeatureDepth = 108, "scene.ground.features.depth_m";
    GroundFeatureRounding = 109, "scene.ground.features.rounding_m";
    RoughnessNoise = 110, "scene.ground.roughness";
    RoughnessRmsHeight = 111, "scene.ground.roughness.rms_height_m";
    RoughnessCorrelationLength = 112, "scene.ground.roughness.correlation_length_m";
    GroundFeatureLip = 113, "scene.ground.features.lip_m";
    RockCount = 120, "scene.rocks.count";
    RockAbundance = 121, "scene.rocks.golombek.abundance";
    RockGolombekCount = 122, "scene.rocks.golombek";
    RockGolombekDiameter = 123, "scene.rocks.golombek.diameter_m";
    RockDiameter = 124, "scene.rocks.diameter_m";
    RockAspect = 125, "scene.rocks.aspect";
    RockElongation = 126, "scene.rocks.elongation";
    RockOffset = 127, "scene.rocks.offset";
    RockFaces = 128, "scene.rocks.faces";
    RockTilt = 129, "scene.rocks.tilt_deg";
    RockPlace = 130, "scene.rocks";
    RockYaw = 131, "scene.rocks.yaw";
    RockShape = 132, "scene.rocks.shape";
    BoxCount = 140, "scene.boxes.count";
    BoxLength = 141, "scene.boxes.length_m";
    BoxWidth = 142, "scene.boxes.width_m";
    BoxHeight = 143, "scene.boxes.height_m";
    BoxPlace = 144, "scene.boxes";
    BoxYaw = 145, "scene.boxes.yaw";
    TreeCount = 150, "scene.trees.count";
    TreeDiameter = 151, "scene.trees.diameter_m";
    TreeHeight = 152, "scene.trees.height_m";
    TreePlace = 153, "scene.trees";
    CrownDiameter = 154, "scene.trees.crown.diameter_m";
    CrownExtinction = 155, "scene.trees.crown.extinction_per_m";
    GrassCount = 160, "scene.vegetation.grass.count";
    GrassRadius = 161, "scene.vegetation.grass.radius_m";
    GrassSigma = 162, "scene.vegetation.grass.sigma_m";
    GrassPlace = 163, "scene.vegetation.grass";
    BrushCount = 165, "scene.vegetation.brush.count";
    BrushRadius = 166, "scene.vegetation.brush.radius_m";
    BrushSigma = 167, "scene.vegetation.brush.sigma_m";
    BrushPlace = 168, "scene.vegetation.brush";
    BushCount = 170, "scene.vegetation.bushes.count";
    BushDiameter = 171, "scene.vegetation.bushes.diameter_m";
    BushHeight = 172, "scene.vegetation.bushes.height_m";
    BushExtinction = 173, "scene.vegetation.bushes.extinction_per_m";
    BushPlace = 174, "scene.vegetation.bushes";
    // Drive: 300-499
    DriveSpeed = 300, "drive.speed_mps";
    StartNearObstacle = 301, "drive.start.near_obstacle_m";
    StraightLength = 302, "drive.path.straight.length_m";
    ArcLength = 303, "drive.path.arc.length_m";
    ArcRadius = 304, "drive.path.arc.radius_m";
    WalkLength = 305, "drive.path.random_walk.length_m";
    WalkLeg = 306, "drive.path.random_walk.leg_m";
    WalkTurn = 307, "drive.path.random_walk.turn_deg";
    TowardLength = 308, "drive.path.toward_obstacle.length_m";
    PlannedGoal = 309, "drive.path.planned.goal_m";
    ControlSpeedSd = 310, "drive.control_noise.speed";
    ControlYawRateSd = 311, "drive.control_noise.yaw_rate";
    ControlHeadingSd = 312, "drive.control_noise.heading_deg_per_sqrt_m";
    ImuSd = 320, "drive.instruments.imu_deg";
    ImuBias = 321, "drive.instruments.imu_bias_deg";
    SunSd = 322, "drive.instruments.sun_deg";
    OdometryDistanceSd = 323, "drive.instruments.odometry_m_per_sqrt_m";
    OdometryHeadingSd = 324, "drive.instruments.odometry_deg_per_sqrt_m";
    Slip = 325, "drive.instruments.slip";
    /// Index = try * 4 + which number.
    StartPlace = 350, "drive.start.place";
    StartHeading = 351, "drive.start.heading";
    /// Index = try.
    GoalDirection = 352, "drive.path.planned.direction";
    /// The rest: index = control step.
    ControlSpeedNoise = 360, "drive.control_noise.speed.draws";
    ControlYawRateNoise = 361, "drive.control_noise.yaw_rate.draws";
    ControlHeadingNoise = 362, "drive.control_noise.heading.draws";
    ImuRollNoise = 370, "drive.instruments.imu.roll";
    ImuPitchNoise = 371, "drive.instruments.imu.pitch";
    /// Index 0: how the bias is shared between roll and pitch.
    ImuBiasAxis = 372, "drive.instruments.imu_bias.axis";
    SunNoise = 373, "drive.instruments.sun.draws";
    OdometryDistanceNoise = 374, "drive.instruments.odometry.distance";
    OdometryHeadingNoise = 375, "drive.instruments.odometry.heading";
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
    SweepRangeSigmaLeast = 518, "sweep.effects.range_noise.min_sigma_m";
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
    SweepIntensity = 605, "sweep.returns.intensity";
    /// Index: slot.
    SweepPatch = 606, "sweep.patch";
    /// Index: slot.
    SweepVolume = 607, "sweep.volume";
    // Slam: 700-799
    /// Index 6 i + k: component k of particle i.
    SlamSample = 700, "slam.fastslam.sample";
    SlamResample = 701, "slam.fastslam.resample";
    /// Index k: component k of the pose.
    SlamSurrogate = 702, "slam.surrogate";
    // Cells: 800-899
    // Train: 900-999
    /// Index: weight.
    InitialWeights = 900, "network.weights";
    /// Step 0, scene = epoch: the order of the row groups.
    TrainGroups = 910, "train.order.row_groups";
    /// Step 0, scene = epoch, index = window: the order of its rows.
    TrainRows = 911, "train.order.rows";
    /// Step = split: the order in which whole scenes are drawn from it.
    TrainScenes = 912, "train.scenes";
    /// Which networks a search takes of all.
    SearchNetworks = 913, "search.networks";
    /// Scene = draw of the bootstrap, step = group of test scenes, and the trainings after the last group; index = how many were drawn before.
    TradeoffBootstrap = 914, "tradeoff.bootstrap";
    /// Index = rows of the training before it: whether it is learnt.
    TrainSelection = 915, "train.filter.ekf.rows";
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
