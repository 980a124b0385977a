//! The slave's application: what makes an encoder out of a DP slave. Machines on the station's own clock alone.
//!
//! # The manual, section by section
//!
//! "Manual" is the one of the POSITAL OCD-DPB1B, of 2007; that of the SCANCON SAG-DPB1B is numbered alike. A test reads
//! this table: each section has its line, and the tests exist.
//!
//! | section | types | tests |
//! |---|---|---|
//! | 2 Data exchange in isochronous mode | [`Unit`](unit::Unit), [`Slave`](crate::dp::slave::Slave) | `section_2_states_and_telegrams_of_data_exchange`, `section_2_rd_inp_and_rd_outp_read_what_data_exchange_carries` |
//! | 2.1 Start-up | [`Isochronous`](isochronous::Isochronous), [`Phase`](crate::observation::Phase) | `section_2_1_1_every_phase_ends_with_data_exchange`, `startup` |
//! | 2.1.1 Slave configuration | [`Slave`](crate::dp::slave::Slave), [`Profile::config`](profile::Profile::config) | `section_2_1_1_states_and_telegrams_of_the_start_up`, `section_2_1_1_another_master_changes_nothing`, `section_2_1_1_another_configuration_is_refused`, `configuration_fault` |
//! | 2.1.2 Synchronising to the clock | [`Pll`](pll::Pll) | `section_2_1_2_the_clock_starts_with_operate_and_data_and_is_locked_after_17_synchs`, `section_2_1_2_in_clear_the_clock_does_not_start`, `section_2_1_2_only_the_own_masters_global_control_counts`, `section_2_1_2_clock_failures_before_lock_make_no_fault`, `section_2_1_2_a_lost_clock_is_fault_0f04_in_each_later_phase_and_everything_begins_anew` |
//! | 2.1.3 Synchronising to the master's sign of life | [`Monitor`](sign_of_life::Monitor) | `section_2_1_3_and_2_1_4_take_16_steps_and_16_cycles_for_every_t_mapc`, `section_2_1_3_any_wrong_value_begins_anew_without_a_fault`, `t_mapc` |
//! | 2.1.4 Synchronising to the slave's sign of life | [`Counter`](sign_of_life::Counter), [`Controller`](controller::Controller) | `section_2_1_3_and_2_1_4_take_16_steps_and_16_cycles_for_every_t_mapc`, `section_2_1_4_any_wrong_value_ends_the_own_sign_of_life_without_a_fault` |
//! | 2.1.5 Cyclic operation | [`Monitor`](sign_of_life::Monitor) | `section_2_1_5_tolerated_failures_and_one_more`, `acknowledge` |
//! | 2.2 Standard telegram 81 | [`Outputs81`](crate::wire::drive::Outputs81), [`Inputs81`](crate::wire::drive::Inputs81), [`Sensor`](sensor::Sensor) | `section_2_2_g1_xist1_is_left_justified_and_g1_xist2_right_justified`, `section_2_2_a_control_word_of_cycle_n_shows_in_the_reply_of_cycle_n_plus_1`, `section_2_2_the_position_latched_at_the_end_of_cycle_n_travels_in_cycle_n_plus_1`, `section_2_2_preset_sets_the_position_to_0_with_the_rising_edge`, `section_2_2_a_preset_with_the_first_request_is_about_its_own_position`, `section_2_2_parking_shows_no_error_and_no_position_and_the_sign_of_life_runs_on`, `preset`, `parking` |
//! | 3 Parameters | [`SetPrm`](crate::wire::prm::SetPrm) | `section_3_1_set_prm_has_59_octets_with_these_fields`, `parameter_fault` |
//! | 3.1 Overview | [`SetPrm`](crate::wire::prm::SetPrm), [`Block`](crate::wire::prm::Block) | `section_3_1_set_prm_has_59_octets_with_these_fields`, `section_3_1_set_prm_of_another_length_is_refused`, `section_3_1_another_ident_or_a_reserved_bit_is_refused`, `section_3_1_sync_and_freeze_are_not_supported`, `section_3_1_each_block_is_there_once_with_its_own_length_and_type`, `section_3_1_without_isochronous_mode_the_encoder_runs_freely`, `section_3_1_the_watchdog_runs_for_its_factors_and_every_request_of_the_master_renews_it` |
//! | 3.2 User parameters | [`UserPrm81`](crate::wire::prm::UserPrm81), [`Disc`](encoder::Disc) | `section_3_1_set_prm_has_59_octets_with_these_fields`, `section_3_1_each_block_is_there_once_with_its_own_length_and_type` |
//! | 3.2.1 Code sequence | [`CodeSequence`](position::CodeSequence) | `section_3_2_1_code_sequence_turns_the_direction_if_enabled` |
//! | 3.2.2 Scaling, preset, counting direction | [`EncoderOptions`](crate::wire::prm::EncoderOptions), [`SensorOptions`](sensor::SensorOptions) | `section_3_2_2_functions_need_375_us_of_t_i_and_gap`, `section_3_2_2_scaling_needs_bits_1_and_3`, `section_3_2_2_a_preset_that_is_not_enabled_is_0f01` |
//! | 3.2.3 Measuring units per revolution | [`Scaling`](position::Scaling) | `section_3_2_3_units_per_revolution_up_to_the_steps_of_the_disc` |
//! | 3.2.4 Total measuring range | [`Position`](position::Position) | `section_3_2_4_total_range_up_to_units_times_revolutions`, `section_3_2_4_the_manuals_example_counts_to_12799`, `scaling` |
//! | 3.2.5 Failures of the master's sign of life | [`MonitorSettings`](sign_of_life::MonitorSettings) | `section_3_2_5_octet_24_is_the_number_of_tolerated_failures` |
//! | 3.3 Isochronous parameters | [`IsoM`](crate::wire::prm::IsoM), [`IsoSettings`](isochronous::IsoSettings) | `section_3_1_set_prm_has_59_octets_with_these_fields`, `parameter_fault` |
//! | 3.3.1 T_BASE_DP | [`IsoM`](crate::wire::prm::IsoM) | `section_3_3_1_t_base_dp_is_one_of_six` |
//! | 3.3.2 T_DP | [`IsoM`](crate::wire::prm::IsoM), [`Profile::t_dp_min`](profile::Profile::t_dp_min) | `section_3_3_2_t_dp_is_500_us_to_32_ms` |
//! | 3.3.3 T_MAPC | [`MonitorSettings`](sign_of_life::MonitorSettings) | `section_3_3_3_t_mapc_is_1_to_14`, `t_mapc` |
//! | 3.3.4 T_BASE_IO | [`IsoM`](crate::wire::prm::IsoM) | `section_3_3_4_t_base_io_is_one_of_six` |
//! | 3.3.5 T_I | [`Profile::t_i_min`](profile::Profile::t_i_min) | `section_3_3_5_t_i_is_125_us_or_more_and_ends_after_t_o` |
//! | 3.3.6 T_O | [`Profile::t_o_min`](profile::Profile::t_o_min), [`Profile::gap_min`](profile::Profile::gap_min) | `section_3_3_6_t_o_is_after_t_dx_and_before_the_latch` |
//! | 3.3.7 T_DX | [`IsoM`](crate::wire::prm::IsoM) | `section_3_3_7_t_dx_counts_in_twelfths_of_a_microsecond` |
//! | 3.3.8 T_PLL_W | [`PllSettings`](pll::PllSettings) | `section_3_3_8_a_window_below_1_us_is_raised_silently` |
//! | 3.3.9 T_PLL_D | [`PllSettings`](pll::PllSettings) | `section_3_3_9_t_pll_d_delays_the_latch_but_not_beyond_the_next_clock` |
//! | 3.4 Slave-to-slave communication | [`Subscriber`](drive::Subscriber), [`Passive`](crate::fdl::passive::Passive) | `section_3_4_a_publisher_answers_msrd_to_everybody`, `slave_to_slave` |
//! | 4 Acyclic services | [`Parameters`](parameters::Parameters), [`Server`](crate::dp::ms1::Server), [`Manager`](crate::dp::ms2::Manager) | `section_4_the_five_parameters_read_as_real_devices_answer`, `section_4_p979_follows_the_scaling`, `section_4_all_are_read_only_and_others_are_unknown`, `section_4_wrong_records_get_the_code_of_dp_v1`, `section_4_one_request_at_a_time_and_none_outlives_data_exchange`, `section_4_without_dpv1_enable_the_access_point_is_closed`, `section_4_a_class_2_master_reads_whatever_the_master_does`, `section_4_each_connection_has_its_own_parameter_channel`, `section_4_a_connection_without_requests_is_aborted`, `read_parameters` |
//! | 5 Error messages and diagnostics | [`Diagnosis`](crate::wire::diag::Diagnosis), [`SensorFault`](crate::wire::drive::SensorFault) | `section_5_1_the_diagnosis_has_six_octets`, `section_5_3_both_faults_pending_are_shown_in_the_order_of_their_coming` |
//! | 5.1 Profibus diagnostics | [`Diagnosis`](crate::wire::diag::Diagnosis) | `section_5_1_the_diagnosis_has_six_octets`, `parameter_fault`, `configuration_fault` |
//! | 5.2 LEDs | [`LedLogic`](leds::LedLogic), [`Leds`](crate::observation::Leds) | `section_5_2_the_six_patterns_on_the_bench`, `section_5_2_with_the_watchdog_off_a_cut_line_stays_data_exchange`, `leds` |
//! | 5.3 Error codes in G1_XIST2 | [`SensorFault`](crate::wire::drive::SensorFault) | `section_5_3_reserved_bits_are_0f01_as_long_as_they_are_set`, `section_5_3_both_faults_pending_are_shown_in_the_order_of_their_coming`, `acknowledge` |

pub mod controller;
pub mod drive;
pub mod encoder;
pub mod isochronous;
pub mod leds;
pub mod links;
pub mod node;
pub mod options;
pub mod parameter_client;
pub mod parameters;
pub mod pll;
pub mod position;
pub mod profile;
pub mod sensor;
pub mod sign_of_life;
pub mod tool;
pub mod unit;
