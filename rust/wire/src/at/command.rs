//! What can be said to the drone.

use crate::unit::Unit;

/// One command, without its sequence number.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// `REF`: take off and stay in the air, or land; it is a state, to be repeated.
    Ref {
        /// Bit 9: in the air while set, landed while clear.
        take_off: bool,
        /// Bit 8: its rising edge cuts the motors, or ends an emergency.
        emergency: bool,
    },
    /// `PCMD`: a motion, in shares of what the drone is set to do at most.
    Move {
        /// Bit 0: move (0: hover, the rest is ignored); bit 1: combined yaw; bit 2: absolute.
        flag: i32,
        /// Right positive.
        roll: Unit,
        /// Backwards positive.
        pitch: Unit,
        /// Vertical speed, up positive.
        gaz: Unit,
        /// Clockwise positive.
        yaw: Unit,
    },
    /// `PCMD_MAG`: a motion relative to a heading that the sender knows.
    MoveFrom {
        /// As of [`Command::Move`].
        flag: i32,
        /// Right positive.
        roll: Unit,
        /// Backwards positive.
        pitch: Unit,
        /// Vertical speed, up positive.
        gaz: Unit,
        /// Clockwise positive.
        yaw: Unit,
        /// The sender's heading, 1 being half a turn.
        heading: Unit,
        /// How well it knows it.
        accuracy: Unit,
    },
    /// `CONFIG`: one setting.
    Config {
        /// `section:key`.
        key: String,
        /// The setting, as text.
        value: String,
    },
    /// `CONFIG_IDS`: for whom the next setting is, 8 hexadecimal digits each.
    ConfigIds {
        /// The session.
        session: String,
        /// The user.
        user: String,
        /// The application.
        application: String,
    },
    /// `CTRL`: 4 asks for the configuration, 5 acknowledges a command, 6 asks for the identifiers.
    Control {
        /// Which of them.
        mode: i32,
    },
    /// `COMWDG`: the link is alive.
    Watchdog,
    /// `FTRIM`: the drone stands level, on the ground.
    FlatTrim,
    /// `CALIB`: turn to calibrate a device, in the air.
    Calibrate {
        /// 0: magnetometer.
        device: i32,
    },
    /// Any other name, with its arguments as they stand.
    Other {
        /// The name.
        name: String,
        /// What stands between the commas after the sequence number, quotes included.
        arguments: Vec<String>,
    },
}
