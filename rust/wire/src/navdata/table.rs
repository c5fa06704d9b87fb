//! The options of navdata: their tags, sizes and fields.
//!
//! Fields have the names of the drone's own headers where these have one.

use super::field::{Degrees, Field, Real, Thousandths, Ticks};
use super::option::{Known, Layout, options, put, take};
use crate::error::{Error, Fault};

/// Tag and size of every option of a full packet, checksum left out: 2190 bytes in all.
pub const FULL: &[(u16, usize)] = &with_tags([
    148, 8, 52, 46, 16, 12, 88, 16, 24, 92, 56, 16, 44, 92, 108, 364, 328, 8, 40, 65, 12, 18, 83,
    64, 72, 32, 8, 216, 6, 32,
]);

/// Each size with its tag: 0, 1, 2, …
#[expect(clippy::indexing_slicing, reason = "evaluated by the compiler")]
const fn with_tags(sizes: [usize; 30]) -> [(u16, usize); 30] {
    let mut options = [(0, 0); 30];
    let mut tag = 0;
    while tag < options.len() {
        options[tag] = (tag as u16, sizes[tag]);
        tag += 1;
    }
    options
}

options! {
    /// The data that every packet in flight holds.
    Demo: tag 0, size 148 {
        /// Detail of the control state.
        minor: u16 as u16 = 4,
        /// Control state: 2 landed, 3 flying, 4 hovering, 6 taking off, 7 going to its position, 8
        /// landing.
        major: u16 as u16 = 6,
        /// Percent.
        battery: u32 as u32 = 8,
        /// rad, nose up positive.
        pitch: f64 as Degrees<1000> = 12,
        /// rad, right side down positive.
        roll: f64 as Degrees<1000> = 16,
        /// rad.
        yaw: f64 as Degrees<1000> = 20,
        /// m; below zero at times.
        height: f64 as Thousandths = 24,
        /// m/s, forwards.
        vx: f64 as Real<1000> = 28,
        /// m/s, to the right.
        vy: f64 as Real<1000> = 32,
        /// m/s; always 0 on this drone.
        vz: f64 as Real<1000> = 36,
        /// Number of the video's frame.
        frame: u32 as u32 = 40,
    }

    /// The drone's clock.
    Clock: tag 1, size 8 {
        /// s; starts again after 2048 s.
        time: f64 as Ticks = 4,
    }

    /// Raw values of the sensors.
    RawMeasures: tag 2, size 52 {
        /// Accelerometer, counts.
        acceleration_x: u16 as u16 = 4,
        /// Accelerometer, counts.
        acceleration_y: u16 as u16 = 6,
        /// Accelerometer, counts.
        acceleration_z: u16 as u16 = 8,
        /// Gyrometer, counts.
        rate_x: i16 as i16 = 10,
        /// Gyrometer, counts.
        rate_y: i16 as i16 = 12,
        /// Gyrometer, counts.
        rate_z: i16 as i16 = 14,
        /// Slow gyrometer, counts.
        slow_rate_x: i16 as i16 = 16,
        /// Slow gyrometer, counts.
        slow_rate_y: i16 as i16 = 18,
        /// mV.
        battery_voltage: u32 as u32 = 20,
        /// m, measured by ultrasound.
        height: f64 as Thousandths = 46,
        /// Of the ultrasound's echo.
        gradient: i16 as i16 = 50,
    }

    /// Sensors, calibrated.
    PhysicalMeasures: tag 3, size 46 {
        /// Of the accelerometer.
        acceleration_temperature: f64 as Real<1> = 4,
        /// Of the gyrometer, counts.
        gyro_temperature: u16 as u16 = 8,
        /// In units of the standard gravity.
        acceleration_x: f64 as Real<1000> = 10,
        /// In units of the standard gravity.
        acceleration_y: f64 as Real<1000> = 14,
        /// In units of the standard gravity.
        acceleration_z: f64 as Real<1000> = 18,
        /// rad/s.
        rate_x: f64 as Degrees<1> = 22,
        /// rad/s.
        rate_y: f64 as Degrees<1> = 26,
        /// rad/s.
        rate_z: f64 as Degrees<1> = 30,
    }

    /// References of the drone's controllers.
    References: tag 6, size 88 {
        /// In the drone's units.
        ref_theta: i32 as i32 = 4,
        /// In the drone's units.
        ref_phi: i32 as i32 = 8,
        /// The clock's word as a number; not the time of a command.
        ui_time: f64 as Real<1> = 64,
        /// Echo of the pitch that was commanded.
        ui_theta: f64 as Real<1> = 68,
        /// Echo of the roll that was commanded.
        ui_phi: f64 as Real<1> = 72,
        /// Echo of the yaw that was commanded.
        ui_psi: f64 as Real<1> = 76,
        /// Echo of its accuracy.
        ui_psi_accuracy: f64 as Real<1> = 80,
        /// 0 on this drone.
        ui_seq: i32 as i32 = 84,
    }

    /// Commands of the remote control; 0 on this drone.
    RcReferences: tag 8, size 24 {
        /// Counts.
        pitch: i32 as i32 = 4,
        /// Counts.
        roll: i32 as i32 = 8,
        /// Counts.
        yaw: i32 as i32 = 12,
        /// Counts.
        gaz: i32 as i32 = 16,
        /// Counts.
        ag: i32 as i32 = 20,
    }

    /// Motors, and the vertical speed that they follow.
    Pwm: tag 9, size 92 {
        /// Of 255.
        motor1: u8 as u8 = 4,
        /// Of 255.
        motor2: u8 as u8 = 5,
        /// Of 255.
        motor3: u8 as u8 = 6,
        /// Of 255.
        motor4: u8 as u8 = 7,
        /// Share of the motors' command that lifts the drone's weight.
        gaz_feed_forward: f64 as Real<1> = 12,
        /// Share of the height controller.
        gaz_altitude: f64 as Real<1> = 16,
        /// Its integral.
        altitude_integral: f64 as Real<1> = 20,
        /// m/s, up positive: the vertical speed that the drone follows.
        vz_ref: f64 as Real<1000> = 24,
    }

    /// Height, by ultrasound and camera.
    Altitude: tag 10, size 56 {
        /// m.
        altitude_vision: f64 as Thousandths = 4,
        /// m/s, down positive.
        altitude_vz: f64 as Real<1000> = 8,
        /// m.
        altitude_ref: f64 as Thousandths = 12,
        /// m, measured by ultrasound, updated every 40 ms.
        altitude_raw: f64 as Thousandths = 16,
    }

    /// The video stream, and the last command that was received.
    VideoStream: tag 19, size 65 {
        /// Quantiser.
        quantiser: u8 as u8 = 4,
        /// Bytes.
        frame_size: u32 as u32 = 5,
        /// Number of the frame.
        frame: u32 as u32 = 9,
        /// Sequence number of the last `REF` that was received.
        atcmd_ref_seq: u32 as u32 = 13,
        /// Mean time between those, ms.
        atcmd_mean_gap: u32 as u32 = 17,
    }

    /// The barometer.
    Pressure: tag 21, size 18 {
        /// Counts.
        raw_pressure: i32 as i32 = 4,
        /// Counts.
        raw_temperature: i16 as i16 = 8,
        /// Tenths of a degree Celsius.
        temperature: i32 as i32 = 10,
        /// Pa.
        pressure: i32 as i32 = 14,
    }

    /// Height and vertical speed, filtered from ultrasound, barometer and accelerometer.
    KalmanPressure: tag 24, size 72 {
        /// Pa or m, in the drone's units.
        offset_pressure: f64 as Real<1> = 4,
        /// m.
        est_z: f64 as Real<1000> = 8,
        /// m/s, up positive.
        est_zdot: f64 as Real<1000> = 12,
    }

    /// The wireless link.
    Wifi: tag 26, size 8 {
        /// In the drone's units.
        link_quality: u32 as u32 = 4,
    }
}
