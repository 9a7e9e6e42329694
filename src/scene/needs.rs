//! What a scene uses, counted once after loading.
