// Stubs for the types of Unity that the components and docs/unity.md use, so that the code can be compiled and tested
// without Unity. The members have the signatures of Unity's reference, and do only what the test needs.
using System;

namespace UnityEngine
{
    [AttributeUsage(AttributeTargets.Field)]
    public sealed class SerializeField : Attribute
    {
    }

    [AttributeUsage(AttributeTargets.Field)]
    public sealed class TooltipAttribute : Attribute
    {
        public TooltipAttribute(string text)
        {
        }
    }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class RequireComponent : Attribute
    {
        public RequireComponent(Type type)
        {
        }
    }

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class DefaultExecutionOrder : Attribute
    {
        public DefaultExecutionOrder(int order)
        {
        }
    }

    public struct Vector2
    {
        public float x, y;

        public Vector2(float x, float y)
        {
            this.x = x;
            this.y = y;
        }
    }

    public struct Vector3
    {
        public float x, y, z;

        public Vector3(float x, float y, float z)
        {
            this.x = x;
            this.y = y;
            this.z = z;
        }

        public static Vector3 operator -(Vector3 a, Vector3 b)
        {
            return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z);
        }

        public static Vector3 operator *(float factor, Vector3 a)
        {
            return new Vector3(factor * a.x, factor * a.y, factor * a.z);
        }

        public static Vector3 zero
        {
            get { return new Vector3(); }
        }
    }

    public struct Quaternion
    {
        public float x, y, z, w;

        public static Quaternion identity
        {
            get { return new Quaternion { w = 1 }; }
        }
    }

    // taichi-soft also has a type with this name.
    public struct Pose
    {
        public Vector3 position;
        public Quaternion rotation;
    }

    public class Object
    {
        public string name { get; set; }

        public static void Destroy(Object thing)
        {
        }
    }

    public class Component : Object
    {
        public Transform transform { get; set; }

        // Unity searches the components of the game object. In this stub, the test sets the component.
        public Component other;

        public T GetComponent<T>() where T : Component
        {
            return (T)other;
        }
    }

    public class Behaviour : Component
    {
        public bool enabled { get; set; }
    }

    public class MonoBehaviour : Behaviour
    {
    }

    public class Transform : Component
    {
        public Vector3 position { get; set; }
        public Quaternion rotation { get; set; }
        public Vector3 forward { get; set; }

        public void SetPositionAndRotation(Vector3 position, Quaternion rotation)
        {
            this.position = position;
            this.rotation = rotation;
        }
    }

    public class Mesh : Object
    {
        public Vector3[] vertices { get; set; }
        public Vector3[] normals { get; set; }
        public Vector2[] uv { get; set; }
        public int[] triangles { get; set; }
        public Rendering.IndexFormat indexFormat { get; set; }

        public void MarkDynamic()
        {
        }

        public void RecalculateBounds()
        {
        }
    }

    public class MeshFilter : Component
    {
        public Mesh sharedMesh { get; set; }
    }

    public enum ForceMode
    {
        Impulse
    }

    public class Rigidbody : Component
    {
        public void AddForce(Vector3 force, ForceMode mode)
        {
        }

        public void AddTorque(Vector3 torque, ForceMode mode)
        {
        }
    }

    public static class Time
    {
        public static float time { get; set; }
        public static float fixedTime { get; set; }
        public static float fixedDeltaTime { get; set; }
    }

    public static class Application
    {
        public static string streamingAssetsPath { get; set; }
    }
}

namespace UnityEngine.Rendering
{
    public enum IndexFormat
    {
        UInt16,
        UInt32
    }
}
