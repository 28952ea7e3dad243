use super::*;

fn kinds(header: &'static str) -> Result<Vec<(String, Kind, String)>, String> {
    let described = Description::of_read("log", header.as_bytes(), None, 10).unwrap();
    let mut columns = columns(&described, &["time_s".to_owned()]);
    assign(&mut columns, &Request::default())?;
    Ok(columns
        .into_iter()
        .map(|column| (column.name, column.kind, column.unit))
        .collect())
}

#[test]
fn names_say_what_columns_are() {
    for (header, expected) in [
        (
            "time_s,plate1_degC,X1_nm\n",
            [(Kind::Temperature, "Cel"), (Kind::Drifting, "nm")],
        ),
        (
            "time_s,t_wall_degC,heatflow_y_Wm2\n",
            [(Kind::Temperature, "Cel"), (Kind::Drifting, "W/m2")],
        ),
        (
            "time_s,lamp_drive_V,t_plate_degC\n",
            [(Kind::Drive, "V"), (Kind::Drifting, "Cel")],
        ),
        (
            "time_s,heater_voltage_V,t_outlet_air_V\n",
            [(Kind::Drive, "V"), (Kind::Drifting, "V")],
        ),
        (
            "time_s,spindle_load_pct,z_um\n",
            [(Kind::Drive, "%"), (Kind::Drifting, "um")],
        ),
        (
            "time_s,temp1,z\n",
            [(Kind::Temperature, "Cel"), (Kind::Drifting, "um")],
        ),
    ] {
        let found = kinds(header).unwrap();
        assert_eq!(found.len(), 2);
        for ((name, kind, unit), expected) in found.iter().zip(expected) {
            assert_eq!((*kind, unit.as_str()), expected, "{name}");
        }
    }
}

#[test]
fn brackets_and_degree_signs_are_units_too() {
    assert_eq!(guess("Temp Plate [°F]", "").unit, "[degF]");
    assert_eq!(guess("Pos Z (µm)", "").unit, "um");
    assert_eq!(guess("Probe Z [mm]", "").guess, Guess::Position);
}

#[test]
fn inches_and_units_behind_a_slash_are_read_where_nothing_else_can_be_meant() {
    for (name, unit) in [
        ("X_inch", "[in_i]"),
        ("X_in", "[in_i]"),
        ("Gap [in]", "[in_i]"),
        ("X_mil", "[mil_i]"),
        ("X_thou", "[mil_i]"),
        ("X_micron", "um"),
        ("X/mm", "mm"),
        ("Probe 1/µm", "um"),
        ("Plate/°C", "Cel"),
        ("T_in", "Cel"),
        ("power_in", "1"),
        ("Z_nm/min", "nm/min"),
        ("Achse A/mm", "1"),
        ("n_1/min", "1/min"),
        ("Drehzahl [1/min]", "1/min"),
        ("Durchfluss (l/min)", "l/min"),
        ("Vorschub [mm/s]", "mm/s"),
        ("Kraft [N]", "N"),
        ("beat_MHz", "MHz"),
        ("tilt_arcsec", "arcsec"),
        ("x [steps]", "1"),
        ("focus_steps", "1"),
        ("x [mm] (raw)", "mm"),
        ("Motor (T1)", "Cel"),
        ("Motor (V2)", "1"),
        ("Motor [A1]", "1"),
        ("Probe (L/R)", "um"),
        ("Probe [2]", "um"),
        ("Probe (a)", "um"),
        ("Z [min]", "um"),
        ("Temp (PV)", "Cel"),
        ("Temp [deg]", "Cel"),
        ("Temp [°]", "Cel"),
        ("Temp [L]", "Cel"),
        ("Temp [N]", "Cel"),
        ("Z [R]", "um"),
        ("T_m", "Cel"),
    ] {
        assert_eq!(guess(name, "").unit, unit, "{name}");
    }
}

#[test]
fn units_in_a_row_below_the_names_are_those_of_the_columns() {
    let found = kinds("time_s;Plate;Z;Load;Gap_mm\n;°C;nm;%;µm\n0;1;2;3;4\n").unwrap();
    let request = found.iter().map(|(_, kind, unit)| (*kind, &**unit));
    assert_eq!(
        request.collect::<Vec<_>>(),
        [
            (Kind::Temperature, "Cel"),
            (Kind::Drifting, "nm"),
            (Kind::Drive, "%"),
            (Kind::Drifting, "um"),
        ]
    );
}

#[test]
fn a_unit_that_the_name_contradicts_is_told() {
    let column = guess("Z_nm", "mm");
    assert_eq!(column.unit, "mm");
    assert_eq!(
        column.why,
        "a length, as the row below its name says, though the name says nm"
    );
}

#[test]
fn a_log_of_temperatures_alone_is_told_that_nothing_drifts() {
    let refused = kinds("time_s,t_machine_degF\n").unwrap_err();
    assert!(refused.starts_with("nothing in it drifts: t_machine_degF may explain a drift"));
}

#[test]
fn a_factor_of_an_axis_is_no_position_of_it() {
    for factor in ["scale_x", "gain_x", "x_factor"] {
        assert_eq!(guess(factor, "").guess, Guess::Other, "{factor}");
    }
    let found = kinds("time_s,plate_degC,X_um,scale_x\n").unwrap();
    assert_eq!(found[1].1, Kind::Drifting);
    assert_eq!(found[2].1, Kind::Drive);
    // A scale may be a glass scale too: it drifts where nothing else could.
    let found = kinds("time_s,plate_degC,scale_x\n").unwrap();
    assert_eq!(found[1].1, Kind::Drifting);
}

#[test]
fn steps_are_no_micrometres_and_their_unit_is_known() {
    let steps = guess("x [steps]", "");
    assert_eq!((steps.guess, steps.unit_known), (Guess::Position, true));
    assert!(!guess("x", "").unit_known);
}

#[test]
fn numbers_of_different_kinds_do_not_drift_together() {
    use Kind::{Drifting, Drive};
    for (header, expected) in [
        ("time_s,a_degC,hum_pct,focus_steps\n", [Drive, Drifting]),
        ("time_s,a_degC,hum_pct,tilt_arcsec\n", [Drive, Drifting]),
        ("time_s,a_degC,load_pct,focus\n", [Drive, Drifting]),
        ("time_s,a_degC,focus,load_pct\n", [Drifting, Drive]),
        ("time_s,a_degC,focus,tilt\n", [Drifting, Drifting]),
        ("time_s,a_degC,f_counts,g\n", [Drifting, Drive]),
        ("time_s,a_degC,supply_V,focus_steps\n", [Drive, Drifting]),
        ("time_s,a_degC,encoder_counts,motor_A\n", [Drifting, Drive]),
        ("time_s,a_degC,flow_lpm,x_arcsec\n", [Drive, Drifting]),
        (
            "time_s,a_degC,Drehzahl [1/min],tilt_arcsec\n",
            [Drive, Drifting],
        ),
        ("time_s,a_degC,I/mA,spot x/px\n", [Drive, Drifting]),
        ("time_s,a_degC,z [mm],f [mm/rev]\n", [Drifting, Drive]),
        ("time_s,a_degC,odometer_km,z_um\n", [Drive, Drifting]),
        ("time_s,a_degC,p_hPa,focus\n", [Drive, Drifting]),
        ("time_s,a_degC,x [steps],y_mm\n", [Drive, Drifting]),
    ] {
        let found = kinds(header).unwrap();
        assert_eq!([found[1].1, found[2].1], expected, "{header}");
    }
}

#[test]
fn what_is_in_the_air_drifts_where_nothing_else_does() {
    let of = |header| kinds(header).unwrap().remove(1).1;
    assert_eq!(of("time_s,room_degC,humidity_pct\n"), Kind::Drifting);
    assert_eq!(of("time_s,lamp_V,druck_bar\n"), Kind::Drifting);
    assert_eq!(of("time_s,room_degC,humidity_pct,lamp_V\n"), Kind::Drive);
}

#[test]
fn columns_that_are_said_to_drift_together_must_be_one_quantity() {
    let request = Request {
        drifting: vec!["a_pct".to_owned(), "b".to_owned()],
        ..Request::default()
    };
    let described = Description::of_read("log", &b"time_s,r_degC,a_pct,b\n"[..], None, 10);
    let mut columns = columns(&described.unwrap(), &["time_s".to_owned()]);
    let refused = assign(&mut columns, &request).unwrap_err();
    assert_eq!(
        refused,
        "`a_pct` and `b` are different quantities (`a_pct` is in %; what unit `b` is in, its name does not say); write a graph \
         for each"
    );
}

#[test]
fn set_points_are_left_out() {
    let found = kinds("time_s,z_mm,t_bed_degC,bed_target_degC\n").unwrap();
    assert_eq!(found[2].1, Kind::Unused);
}
