//! Tables of Arrow, in from any Python object that has some and out to whoever takes some. Not what a column means.

use std::collections::HashMap;
use std::ffi::CStr;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::ffi_stream::RecordBatchStreamReader;
use arrow_array::types::{
    ArrowPrimitiveType, ArrowTimestampType, Float64Type, Int64Type, TimestampMicrosecondType,
    TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType,
};
use arrow_array::{
    ArrayRef, BooleanArray, PrimitiveArray, RecordBatch, RecordBatchIterator, RecordBatchOptions,
    RecordBatchReader as _, StringArray, make_array,
};
use arrow_ipc::reader::StreamReader;
use arrow_ipc::writer::StreamWriter;
use arrow_pyarrow::FromPyArrow;
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use pyo3::exceptions::{PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyList};

use crate::stamps;

const STREAM: &CStr = c"arrow_array_stream";

/// A table in memory, made of batches of Arrow.
#[pyclass(frozen, module = "athermal._athermal")]
pub struct Table {
    pub schema: SchemaRef,
    pub batches: Arc<[RecordBatch]>,
}

fn unfit(error: &ArrowError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

impl Table {
    /// A table of one batch.
    pub fn of(columns: Vec<(String, ArrayRef)>) -> Result<Self, ArrowError> {
        let fields = columns
            .iter()
            .map(|(name, of)| Field::new(name, of.data_type().clone(), true));
        let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()));
        let rows = columns.first().map_or(0, |(_, of)| of.len());
        let options = RecordBatchOptions::new().with_row_count(Some(rows));
        let columns = columns.into_iter().map(|(_, of)| of).collect();
        let batch = RecordBatch::try_new_with_options(Arc::clone(&schema), columns, &options)?;
        Ok(Self {
            schema,
            batches: Arc::new([batch]),
        })
    }

    fn type_of(&self, name: &str) -> PyResult<&DataType> {
        let field = self.schema.field_with_name(name);
        let field = field.map_err(|_| PyKeyError::new_err(name.to_owned()))?;
        Ok(field.data_type())
    }

    fn with_schema(&self, schema: Schema) -> Result<Self, ArrowError> {
        let schema = Arc::new(schema);
        let batches = self.batches.iter().map(|of| {
            let options = RecordBatchOptions::new().with_row_count(Some(of.num_rows()));
            let columns = of.columns().to_vec();
            RecordBatch::try_new_with_options(Arc::clone(&schema), columns, &options)
        });
        Ok(Self {
            batches: batches.collect::<Result<Vec<_>, _>>()?.into(),
            schema,
        })
    }
}

#[pymethods]
impl Table {
    /// The table of an object with `__arrow_c_stream__` or `__arrow_c_array__`. Its numbers are not copied.
    #[staticmethod]
    fn from_arrow(py: Python<'_>, of: &Bound<'_, PyAny>) -> PyResult<Self> {
        if of.hasattr("__arrow_c_stream__")? {
            let mut reader = RecordBatchStreamReader::from_pyarrow_bound(of)?;
            // Whoever makes the stream may need Python, on whatever thread.
            let read = py.detach(move || {
                let schema = reader.schema();
                let batches = reader.by_ref().collect::<Result<Vec<_>, _>>()?;
                Ok((schema, batches))
            });
            let (schema, batches) = read.map_err(|error| unfit(&error))?;
            let batches = batches.into();
            return Ok(Self { schema, batches });
        }
        if of.hasattr("__arrow_c_array__")? {
            let batch = RecordBatch::from_pyarrow_bound(of)?;
            let schema = batch.schema();
            let batches = Arc::new([batch]);
            return Ok(Self { schema, batches });
        }
        Err(PyTypeError::new_err(format!(
            "{} has neither `__arrow_c_stream__` nor `__arrow_c_array__`",
            of.get_type().name()?
        )))
    }

    /// A table of columns: each a name, what it has, and it. What it has is `float`, `int`, `bool`, `text`, the unit of instants with
    /// their zone behind it (`us Europe/Berlin`), or `arrow`, which is an array of it. Numbers and instants may be the bytes of all, of
    /// 64 bits each, or these with a byte for each that says whether it is absent; else it is a list with `None` where there is nothing.
    #[staticmethod]
    fn from_columns(columns: Vec<(String, String, Bound<'_, PyAny>)>) -> PyResult<Self> {
        let columns = columns.into_iter().map(|(name, has, of)| {
            let array: ArrayRef = match &*has {
                "float" => Arc::new(numbers::<Float64Type>(&of, |_| false)?),
                "int" => Arc::new(numbers::<Int64Type>(&of, |_| false)?),
                "bool" => Arc::new(BooleanArray::from(of.extract::<Vec<Option<bool>>>()?)),
                "text" => Arc::new(StringArray::from(of.extract::<Vec<Option<String>>>()?)),
                "arrow" => make_array(FromPyArrow::from_pyarrow_bound(&of)?),
                clock => instants(clock, &of)?,
            };
            Ok((name, array))
        });
        Self::of(columns.collect::<PyResult<_>>()?).map_err(|error| unfit(&error))
    }

    /// Tables with the same columns, one after the other.
    #[staticmethod]
    fn joined(tables: Vec<Py<Self>>) -> PyResult<Self> {
        let schema = tables.first().map(|of| Arc::clone(&of.get().schema));
        let schema = schema.ok_or_else(|| PyValueError::new_err("there are no pieces"))?;
        let kinds = |of: &Schema| -> Vec<(String, DataType)> {
            let fields = of.fields().iter();
            let kinds = fields.map(|of| (of.name().clone(), of.data_type().clone()));
            kinds.collect()
        };
        let expected = kinds(&schema);
        let mut batches = Vec::new();
        for (nth, table) in tables.iter().enumerate() {
            let (table, found) = (table.get(), kinds(&table.get().schema));
            if found != expected {
                let differs = |of: &&(String, DataType)| !expected.contains(of);
                let other = found.iter().find(differs).map_or_else(
                    || "it lacks columns".to_owned(),
                    |(name, of)| format!("`{name}` is of type {of} there"),
                );
                return Err(PyValueError::new_err(format!(
                    "piece {} differs from the first: {other}",
                    nth + 1
                )));
            }
            let all = table.with_schema(schema.as_ref().clone());
            batches.extend_from_slice(&all.map_err(|error| unfit(&error))?.batches);
        }
        let batches = batches.into();
        Ok(Self { schema, batches })
    }

    /// The rows from one to another, which are not copied.
    #[pyo3(signature = (from, to, /))]
    fn rows(&self, from: usize, to: usize) -> Self {
        let mut before = 0;
        let slices = self.batches.iter().filter_map(|batch| {
            let (begin, rows) = (before, batch.num_rows());
            before += rows;
            let (from, to) = (from.max(begin), to.min(before));
            (from < to).then(|| batch.slice(from - begin, to - from))
        });
        Self {
            batches: slices.collect(),
            schema: Arc::clone(&self.schema),
        }
    }

    /// Some columns, in this order.
    fn only(&self, names: Vec<String>) -> PyResult<Self> {
        let places = names.iter().map(|name| {
            let place = self.schema.index_of(name);
            place.map_err(|_| PyKeyError::new_err(name.clone()))
        });
        let places = places.collect::<PyResult<Vec<_>>>()?;
        let schema = self.schema.project(&places);
        let batches = self.batches.iter().map(|of| of.project(&places));
        let made = schema.and_then(|schema| {
            Ok(Self {
                batches: batches.collect::<Result<Vec<_>, _>>()?.into(),
                schema: Arc::new(schema),
            })
        });
        made.map_err(|error| unfit(&error))
    }

    /// The table as bytes, a stream of Arrow's format between processes.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let written = || -> Result<Vec<u8>, ArrowError> {
            let mut writer = StreamWriter::try_new(Vec::new(), &self.schema)?;
            for batch in &*self.batches {
                writer.write(batch)?;
            }
            writer.into_inner()
        };
        let bytes = written().map_err(|error| unfit(&error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// The table of such bytes.
    #[staticmethod]
    fn of_bytes(bytes: &[u8]) -> PyResult<Self> {
        let read = || -> Result<Self, ArrowError> {
            let reader = StreamReader::try_new(bytes, None)?;
            let schema = reader.schema();
            let batches = reader.collect::<Result<Vec<_>, _>>()?.into();
            Ok(Self { schema, batches })
        };
        read().map_err(|error| unfit(&error))
    }

    /// The same table with other names for some columns. A column that has one of these names already has another then.
    fn renamed(&self, names: HashMap<String, String>) -> PyResult<Self> {
        let fields = self.schema.fields().iter().map(|field| {
            let field = field.as_ref().clone();
            let is_taken = names.values().any(|name| name == field.name());
            let name = match names.get(field.name()) {
                Some(name) => name.clone(),
                None if is_taken => format!("{} (passed over)", field.name()),
                None => return field,
            };
            field.with_name(name)
        });
        let renamed = self.with_schema(Schema::new(fields.collect::<Vec<_>>()));
        renamed.map_err(|error| unfit(&error))
    }

    /// What a column has: `float`, `int`, `instants`, `bool` or `text`.
    fn has(&self, name: &str) -> PyResult<&'static str> {
        Ok(match self.type_of(name)? {
            DataType::Timestamp(..) => "instants",
            DataType::Boolean => "bool",
            of if of.is_integer() => "int",
            of if of.is_numeric() => "float",
            _ => "text",
        })
    }

    /// The unit of instants and their zone; `None` of what has none.
    fn clock(&self, name: &str) -> PyResult<Option<(&'static str, Option<String>)>> {
        Ok(match self.type_of(name)? {
            DataType::Timestamp(unit, zone) => {
                Some((stamps::called(*unit), zone.as_deref().map(str::to_owned)))
            }
            _ => None,
        })
    }

    fn __len__(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }

    /// The names of the columns.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        let fields = self.schema.fields().iter();
        fields.map(|field| field.name().clone()).collect()
    }

    /// A column as a list: numbers and texts, instants as ns since 1970, and `None` where there is nothing.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyList>> {
        let place = self.schema.index_of(name);
        let place = place.map_err(|_| PyKeyError::new_err(name.to_owned()))?;
        let all = PyList::empty(py);
        for batch in &*self.batches {
            append(batch.column(place), &all)?;
        }
        Ok(all)
    }

    /// All columns as lists.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for name in self.column_names() {
            all.set_item(&name, self.column(py, &name)?)?;
        }
        Ok(all)
    }

    /// The table as a stream of Arrow, for whoever takes one.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // Another schema is a wish, which may be passed over.
        drop(requested_schema);
        let batches: Vec<_> = self.batches.iter().cloned().map(Ok).collect();
        let reader = RecordBatchIterator::new(batches, Arc::clone(&self.schema));
        let stream = FFI_ArrowArrayStream::new(Box::new(reader));
        PyCapsule::new_with_value(py, stream, STREAM)
    }
}

/// Numbers of 64 bits: of bytes, of bytes and a byte for each that is absent, or of a list. `is_absent` knows those that stand for none.
fn numbers<T>(
    of: &Bound<'_, PyAny>,
    is_absent: fn(T::Native) -> bool,
) -> PyResult<PrimitiveArray<T>>
where
    T: ArrowPrimitiveType,
    T::Native: From8 + for<'a, 'py> FromPyObject<'a, 'py>,
{
    let (bytes, mask) = match of.extract::<(Bound<'_, PyAny>, Vec<u8>)>() {
        Ok((bytes, mask)) => (bytes, Some(mask)),
        Err(_) => (of.clone(), None),
    };
    let Ok(bytes) = bytes.extract::<&[u8]>() else {
        return Ok(of
            .extract::<Vec<Option<T::Native>>>()?
            .into_iter()
            .collect());
    };
    let (words, _) = bytes.as_chunks::<8>();
    let values = words.iter().map(|word| T::Native::from_8(*word));
    if mask.is_none() && !values.clone().any(is_absent) {
        return Ok(PrimitiveArray::from_iter_values(values));
    }
    let mask = mask.unwrap_or_default().into_iter();
    let there = values.zip(mask.chain(std::iter::repeat(0)));
    let there = there.map(|(of, absent)| (absent == 0 && !is_absent(of)).then_some(of));
    Ok(there.collect())
}

/// Instants by a clock: its unit, and the zone behind it.
fn instants(clock: &str, of: &Bound<'_, PyAny>) -> PyResult<ArrayRef> {
    fn with<T: ArrowTimestampType>(
        of: &Bound<'_, PyAny>,
        zone: Option<&str>,
    ) -> PyResult<ArrayRef> {
        // As numpy has it.
        let instants = numbers::<T>(of, |at| at == i64::MIN)?;
        Ok(Arc::new(instants.with_timezone_opt(zone)))
    }
    let (unit, zone) = match clock.split_once(' ') {
        Some((unit, zone)) => (unit, Some(zone)),
        None => (clock, None),
    };
    match unit {
        "s" => with::<TimestampSecondType>(of, zone),
        "ms" => with::<TimestampMillisecondType>(of, zone),
        "us" => with::<TimestampMicrosecondType>(of, zone),
        "ns" => with::<TimestampNanosecondType>(of, zone),
        other => Err(PyValueError::new_err(format!("no column has `{other}`"))),
    }
}

/// A number of 64 bits from its bytes, as this machine has them.
trait From8 {
    fn from_8(bytes: [u8; 8]) -> Self;
}

impl From8 for f64 {
    fn from_8(bytes: [u8; 8]) -> Self {
        Self::from_ne_bytes(bytes)
    }
}

impl From8 for i64 {
    fn from_8(bytes: [u8; 8]) -> Self {
        Self::from_ne_bytes(bytes)
    }
}

/// Adds the values of a column that this package makes to a list.
fn append(array: &ArrayRef, all: &Bound<'_, PyList>) -> PyResult<()> {
    match array.data_type() {
        DataType::Float64 => array
            .as_primitive::<Float64Type>()
            .iter()
            .try_for_each(|value| all.append(value)),
        DataType::Int64 => array
            .as_primitive::<Int64Type>()
            .iter()
            .try_for_each(|value| all.append(value)),
        DataType::Boolean => array
            .as_boolean()
            .iter()
            .try_for_each(|value| all.append(value)),
        DataType::Utf8 => array
            .as_string::<i32>()
            .iter()
            .try_for_each(|value| all.append(value)),
        DataType::Timestamp(unit, _) => stamps::ns_of(array, *unit)
            .into_iter()
            .try_for_each(|at| all.append(at)),
        other => Err(PyTypeError::new_err(format!(
            "a column of {other} is not shown as a list; take the table by `__arrow_c_stream__`"
        ))),
    }
}
