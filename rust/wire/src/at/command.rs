//! Commands to the drone.

use crate::unit::Unit;

/// One command, without its sequence number.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// `REF`: take off and stay in the air, or land. It is a state and has to be repeated.
    Ref {
        /// Bit 9: in the air while set, landed while clear.
        take_off: bool,
        /// Bit 8: its rising edge stops the motors, or ends an emergency.
        emergency: bool,
    },
    /// `PCMD`: a motion, as shares of the limits that are set in the drone.
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
    /// `PCMD_MAG`: a motion relative to a heading that the sender measures.
    MoveFrom {
        /// The same as in [`Command::Move`].
        flag: i32,
        /// Right positive.
        roll: Unit,
        /// Backwards positive.
        pitch: Unit,
        /// Vertical speed, up positive.
        gaz: Unit,
        /// Clockwise positive.
        yaw: Unit,
        /// The sender's heading; 1 is half a turn.
        heading: Unit,
        /// The accuracy of this heading.
        accuracy: Unit,
    },
    /// `CONFIG`: one setting.
    Config {
        /// `section:key`.
        key: String,
        /// The setting, as text.
        value: String,
    },
    /// `CONFIG_IDS`: identifiers of the recipient of the next setting, 8 hexadecimal digits each.
    ConfigIds {
        /// The session.
        session: String,
        /// The user.
        user: String,
        /// The application.
        application: String,
    },
    /// `CTRL`: 4 requests the configuration, 5 acknowledges a command, 6 requests the identifiers.
    Control {
        /// The mode.
        mode: i32,
    },
    /// `COMWDG`: the link is alive.
    Watchdog,
    /// `FTRIM`: the drone stands level on the ground.
    FlatTrim,
    /// `CALIB`: turn in the air to calibrate a device.
    Calibrate {
        /// 0: magnetometer.
        device: i32,
    },
    /// Any other name, with its arguments unchanged.
    Other {
        /// The name.
        name: String,
        /// The text between the commas after the sequence number, quotes included.
        arguments: Vec<String>,
    },
}
