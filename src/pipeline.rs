//! The whole flow on one screen: a plan and a scene number -> one scene's rows.
