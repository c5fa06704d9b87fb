//! The bindings of the `deadtime` core to Python: they convert and do nothing else.

mod arrays;
mod boxes;
mod called;
mod calls;
mod certificate;
mod commanded;
mod commands;
mod csv;
mod dde;
mod errors;
mod estimation;
mod family;
mod fixed_step;
mod flight;
mod flight_plant;
mod frequency;
mod inputs;
mod judgement;
mod known_filter;
mod least_squares;
mod literature;
mod loading;
mod loops;
mod matrix;
mod online;
mod pointers;
mod profile;
mod quasipoly;
mod reserve;
mod runtime;
mod solver;
mod special;
mod stability;
mod systems;
mod tuning;
mod ufunc;
mod wire;

use pyo3::prelude::*;

/// Native part of the `deadtime` package; use the names of `deadtime` instead.
#[pymodule(gil_used = false)]
mod _deadtime {
    #[pymodule_export]
    use super::boxes::{
        ProvedBoxes, StabilityRadius, largest_stable_box, proved_boxes, robust_map,
        stability_radius,
    };
    #[pymodule_export]
    use super::called::{interval_end, mixture_interval, secant_ends, shared_number};
    #[pymodule_export]
    use super::certificate::{Certificate, Contour, Monotone, Segment};
    #[pymodule_export]
    use super::commanded::{CommandedMisfit, RoundedPeak, RoundedReadings};
    #[pymodule_export]
    use super::commands::HeldCommands;
    #[pymodule_export]
    use super::csv::{CsvColumns, csv_columns};
    #[pymodule_export]
    use super::dde::{PyLinearLoop, PyLoopResponse, on_samples, rate_limited};
    #[pymodule_export]
    use super::estimation::{
        PlantNumbers, RowLikelihood, RowNoise, coarse_step, felt_plant, follows_command,
        held_response, independent_samples, most_moved, regular_times, whitened_columns,
    };
    #[pymodule_export]
    use super::family::{FamilyCandidate, FamilyFit, fit_family};
    #[pymodule_export]
    use super::fixed_step::FixedStepResponse;
    #[pymodule_export]
    use super::flight::{FlightFit, FlightRows};
    #[pymodule_export]
    use super::flight_plant::FlightPlant;
    #[pymodule_export]
    use super::frequency::{
        PyCrossings, PyMargins, corner_range, crossings, damping_range, delay_margin, delay_range,
        end_of_gain, gain_range, hinf_norm, loop_margins, ratio,
    };
    #[pymodule_export]
    use super::inputs::{
        DeviationFigures, SweepFigures, deviation_figures, driven_loop, sweep_deviations,
    };
    #[pymodule_export]
    use super::judgement::{FlightFinding, FlightJudgement, whiteness};
    #[pymodule_export]
    use super::known_filter::KnownFilter;
    #[pymodule_export]
    use super::least_squares::{
        ChebyshevMisfit, LeastSquares, LeastSquaresMinimum, LinesMisfit, LoopMisfit,
    };
    #[pymodule_export]
    use super::literature::{
        HeldResponse, LimitCycle, PathAt, arx_losses, correlation_coefficient, correlation_peak,
        delay_of_rate, extremes_decay, feedback_test, first_movement, held_losses, line_through,
        loop_of_extremes, rise_tangent, step_extremes, step_tail, x_of_overshoot,
    };
    #[pymodule_export]
    use super::loops::{
        LoopSensitivities, PyHeldPlane, PyLoop, SweepMetrics, SweepResponses, canonical_form,
        feedback_polynomials, first_duration, plant_polynomials, sampled_filter,
    };
    #[pymodule_export]
    use super::matrix::CharacteristicMatrix;
    #[pymodule_export]
    use super::online::{BankAnswer, OnlineBank};
    #[pymodule_export]
    use super::profile::{FlightProfile, FreeNumbers};
    #[pymodule_export]
    use super::quasipoly::{Expansion, QuasiPolynomial, Ratio};
    #[pymodule_export]
    use super::quasipoly::{RootSet, Sensitivity};
    #[pymodule_export]
    #[pymodule_export]
    use super::solver::{DelayPieces, DelayRun, solve_dde};
    #[pymodule_export]
    use super::special::{dde_root_number, lambertw_number, lambertw0_number, lambertwm1_number};
    #[pymodule_export]
    use super::stability::{MapBoundary, MapCells, PyFamily};
    #[pymodule_export]
    use super::systems::{
        FittedSeries, LinearSystemResponse, PyLinearSystem, PySignal, fitted_series,
    };
    #[pymodule_export]
    use super::tuning::{
        FoundGains, GainSearch, PyCandidates, RobustGains, UnmetMargins, half_rule, lasting_load,
        noise_gain, proved_step, robust_gains, tuning_rules,
    };
    #[pymodule_export]
    use super::ufunc::limit_threads;
    #[pymodule_export]
    use super::wire::{
        AtCommand, BlackboxFrames, Navdata, NavdataLayout, NavdataOption, PyLoopPacket, at_read,
        at_write, blackbox_frames, configuration_read, configuration_write, doubles_read,
        doubles_write, loop_packet_read, loop_packet_write, navdata_full, navdata_layouts,
        navdata_read, navdata_write,
    };
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Where there is no memory for it now, each call asks again.
        let _ = super::reserve::ready();
        super::loading::load_numpy(module.py(), || super::special::add_ufuncs(module))?;
        super::flight::add_constants(module)?;
        module.add("LOAD_SLACK", deadtime::tuning::SLACK)?;
        super::pointers::add_pointers(module)
    }
}
