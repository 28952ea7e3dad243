//! Tables of Arrow, in from any Python object that has some and out to whoever takes some. Not what a column means.

use std::collections::HashMap;
use std::ffi::CStr;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::ffi_stream::RecordBatchStreamReader;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{
    ArrayRef, BooleanArray, Float64Array, Int64Array, PrimitiveArray, RecordBatch,
    RecordBatchIterator, RecordBatchOptions, RecordBatchReader as _, StringArray,
    TimestampNanosecondArray,
};
use arrow_pyarrow::FromPyArrow;
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use pyo3::exceptions::{PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyList};

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

    /// A table of columns: each a name, what it has (`float`, `int`, `ns` of instants, `bool` or `text`), and it: the bytes of all
    /// numbers of 64 bits, or a list with `None` where there is nothing.
    #[staticmethod]
    fn from_columns(columns: Vec<(String, String, Bound<'_, PyAny>)>) -> PyResult<Self> {
        fn numbers<T>(of: &Bound<'_, PyAny>) -> PyResult<Option<PrimitiveArray<T>>>
        where
            T: arrow_array::ArrowPrimitiveType,
            T::Native: From8,
        {
            let Ok(bytes) = of.extract::<&[u8]>() else {
                return Ok(None);
            };
            let (words, _) = bytes.as_chunks::<8>();
            let values = words.iter().map(|word| T::Native::from_8(*word));
            Ok(Some(PrimitiveArray::from_iter_values(values)))
        }
        let columns = columns.into_iter().map(|(name, has, of)| {
            let array: ArrayRef = match &*has {
                "float" => match numbers::<Float64Type>(&of)? {
                    Some(array) => Arc::new(array),
                    None => Arc::new(Float64Array::from(of.extract::<Vec<Option<f64>>>()?)),
                },
                "int" => match numbers::<Int64Type>(&of)? {
                    Some(array) => Arc::new(array),
                    None => Arc::new(Int64Array::from(of.extract::<Vec<Option<i64>>>()?)),
                },
                "ns" => {
                    let instants = of.extract::<Vec<Option<i64>>>()?;
                    Arc::new(TimestampNanosecondArray::from(instants))
                }
                "utc" => {
                    let instants = of.extract::<Vec<Option<i64>>>()?;
                    Arc::new(TimestampNanosecondArray::from(instants).with_timezone("UTC"))
                }
                "bool" => Arc::new(BooleanArray::from(of.extract::<Vec<Option<bool>>>()?)),
                _ => Arc::new(StringArray::from(of.extract::<Vec<Option<String>>>()?)),
            };
            Ok((name, array))
        });
        Self::of(columns.collect::<PyResult<_>>()?).map_err(|error| unfit(&error))
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

    /// What a column has: `float`, `int`, `ns` or `utc` of instants, `bool` or `text`.
    fn has(&self, name: &str) -> PyResult<&'static str> {
        let field = self.schema.field_with_name(name);
        let field = field.map_err(|_| PyKeyError::new_err(name.to_owned()))?;
        Ok(match field.data_type() {
            DataType::Timestamp(_, None) => "ns",
            DataType::Timestamp(..) => "utc",
            DataType::Boolean => "bool",
            of if of.is_integer() => "int",
            of if of.is_numeric() => "float",
            _ => "text",
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
